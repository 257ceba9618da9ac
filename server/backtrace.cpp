#include "server/backtrace.h"

#include <cxxabi.h>
#include <execinfo.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <sstream>
#include <vector>

#include "server/program_symbols.h"

namespace strata::server {
namespace {

constexpr char kBegin[] = "== backtrace\n";
constexpr int kMaxFrames = 64;
constexpr std::size_t kShownFrames = 40;
constexpr std::size_t kMaxLine = 200;
constexpr std::size_t kStackBytes = std::size_t{64} << 10;

void write_backtrace() {
  void* frames[kMaxFrames];
  const int count = backtrace(frames, kMaxFrames);
  static_cast<void>(!write(STDERR_FILENO, kBegin, sizeof kBegin - 1));
  backtrace_symbols_fd(frames, count, STDERR_FILENO);
}

void on_crash(int signal) {
  write_backtrace();
  std::signal(signal, SIG_DFL);
  raise(signal);
}

void on_look(int) { write_backtrace(); }

void handle(int signal, void (*handler)(int), int flags) {
  struct sigaction action{};
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigaction(signal, &action, nullptr);
}

// The address in "(+0x66b1)" is where the call returns to; the call was before.
std::uint64_t before_return(const std::string& line, std::size_t plus) { return std::strtoull(line.c_str() + plus + 1, nullptr, 16) - 1; }

// "program(_ZN6strata...+0x1f) [0x55...]" -> the name; the module when there is none.
std::string call_of(const std::string& line, const ProgramSymbols& program) {
  const std::size_t open = line.find('('), plus = line.find_first_of("+)", open);
  if (open == std::string::npos || plus == std::string::npos) return line;
  std::string mangled = line.substr(open + 1, plus - open - 1);
  const bool ours = line.compare(0, open, kProgramName) == 0;
  if (mangled.empty() && ours && line[plus] == '+') mangled = program.at(before_return(line, plus));
  if (mangled.empty()) return line.substr(line.rfind('/', open) + 1);
  int status = 0;
  const std::unique_ptr<char, decltype(&std::free)> name(abi::__cxa_demangle(mangled.c_str(), nullptr, nullptr, &status), &std::free);
  return status == 0 ? std::string(name.get()) : mangled;
}

// The frames of the handler end with the one that libc puts between it and what was interrupted.
std::size_t frames_of_handler(const std::vector<std::string>& lines) {
  constexpr std::size_t kMost = 4;
  for (std::size_t i = 0; i < std::min(kMost, lines.size()); ++i)
    if (lines[i].find("libc.so") != std::string::npos) return i + 1;
  return 0;
}

}  // namespace

void report_crashes() {
  void* loads_the_unwinder[1];
  backtrace(loads_the_unwinder, 1);  // the first call allocates: not in a handler
  // A stack that overflowed cannot run its own handler. The main thread's; worker threads overflow into theirs.
  static std::array<char, kStackBytes> stack;
  stack_t alternative{};
  alternative.ss_sp = stack.data();
  alternative.ss_size = stack.size();
  sigaltstack(&alternative, nullptr);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) handle(signal, on_crash, SA_ONSTACK | SA_RESETHAND);
  handle(SIGUSR1, on_look, SA_RESTART | SA_ONSTACK);
}

std::string backtrace_in(const std::string& written, const std::string& program) {
  const std::size_t begin = written.rfind(kBegin);
  if (begin == std::string::npos) return {};
  const ProgramSymbols symbols(program);
  std::istringstream rest(written.substr(begin + sizeof kBegin - 1));
  std::vector<std::string> lines;
  for (std::string line; std::getline(rest, line) && line.find('[') != std::string::npos;) lines.push_back(line);
  const std::size_t first = frames_of_handler(lines);
  std::string text;
  for (std::size_t i = first; i < std::min(lines.size(), first + kShownFrames); ++i)
    text += call_of(lines[i], symbols).substr(0, kMaxLine) + "\n";
  return text;
}

}  // namespace strata::server
