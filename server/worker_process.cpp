#include "server/worker_process.h"

#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <string_view>

#include "server/worker.h"

namespace strata::server {
namespace {

constexpr std::chrono::milliseconds kLook{20};  // between looks at cancellation and memory
constexpr std::size_t kErrorsKept = std::size_t{64} << 10;

// Reads until there is nothing more now; false at the end of the stream.
template <class Sink>
bool take(int fd, const Sink& sink) {
  char buffer[1 << 16];
  while (true) {
    const ssize_t n = read(fd, buffer, sizeof buffer);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return true;
    if (n == 0) return false;
    sink(std::string_view(buffer, static_cast<std::size_t>(n)));
  }
}

}  // namespace

WorkerProcess::WorkerProcess(const std::string& program)
    : program_(program), child_(program, {kProgramName, kWorkerFlag, std::to_string(getpid())}) {}

void WorkerProcess::tell(const strata::worker::v1::Command& command) { static_cast<void>(write_message(child_.input(), command)); }

bool WorkerProcess::look(const Hear& hear) {
  keep_errors();
  const bool open = take(child_.output(), [this](std::string_view bytes) { reports_.add(bytes); });
  strata::worker::v1::Report report;
  while (const auto bytes = reports_.next()) {
    if (!report.ParseFromString(*bytes)) kill();
    else hear(report);
  }
  if (reports_.damaged()) kill();
  return open;
}

void WorkerProcess::wait_a_little() const {
  pollfd files[] = {{child_.output(), POLLIN, 0}, {child_.errors(), POLLIN, 0}};
  poll(files, 2, static_cast<int>(kLook.count()));
}

void WorkerProcess::kill() const { child_.kill(SIGKILL); }

void WorkerProcess::ask_where() const { child_.kill_main_thread(SIGUSR1); }

ChildEnd WorkerProcess::end() {
  const ChildEnd end = child_.wait();
  keep_errors();
  return end;
}

void WorkerProcess::keep_errors() {
  take(child_.errors(), [this](std::string_view bytes) {
    errors_ += bytes;
    if (errors_.size() > 2 * kErrorsKept) errors_.erase(0, errors_.size() - kErrorsKept);
  });
}

bool ran_out_of_memory(const ChildEnd& end) { return WIFEXITED(end.status) && WEXITSTATUS(end.status) == kOutOfMemoryExit; }

std::string how_it_ended(const ChildEnd& end) {
  if (!WIFSIGNALED(end.status)) return "exit status " + std::to_string(WEXITSTATUS(end.status));
  return "signal " + std::to_string(WTERMSIG(end.status)) + " (" + strsignal(WTERMSIG(end.status)) + ")";
}

}  // namespace strata::server
