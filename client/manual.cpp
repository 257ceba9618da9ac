#include "client/manual.h"

#include <CLI/CLI.hpp>
#include <sstream>

#include "client/exit_code.h"
#include "client/version.h"

namespace strata::client {
namespace {

struct Meaning {
  ExitCode code;
  const char* text;
};
constexpr Meaning kMeanings[] = {
    {ExitCode::Ok, "done"},
    {ExitCode::JobFailed, "the job failed"},
    {ExitCode::Usage, "the command line or a setting is wrong"},
    {ExitCode::InputRejected, "the surface or the specification cannot be meshed"},
    {ExitCode::NotAuthorised, "the server does not know the caller, or the caller may not do this"},
    {ExitCode::NotFound, "there is no such job or result"},
    {ExitCode::Unreachable, "the server does not answer, or the retries are spent"},
    {ExitCode::Timeout, "the time of --timeout is over; the job goes on"},
    {ExitCode::Cancelled, "the job was cancelled"},
    {ExitCode::QualityMissed, "the mesh was written but misses its quality goal"},
    {ExitCode::Overload, "a queue, a quota or a budget is full"},
    {ExitCode::Integrity, "bytes arrived damaged"},
    {ExitCode::LocalIo, "a file here cannot be read or written"},
    {ExitCode::VersionMismatch, "client and server do not understand each other"},
    {ExitCode::Bug, "a defect of this program"},
};

// What roff would take for its own.
std::string roff(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '\\' || c == '-') safe += '\\';
    safe += c;
    if (c == '\n') safe += "\\&";
  }
  return safe;
}

void add_options(const CLI::App& app, std::ostream& out) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    out << ".TP\n.B " << roff(option->get_name(false, true)) << "\n" << roff(option->get_description()) << "\n";
    if (!option->get_envname().empty()) out << "Environment: " << roff(option->get_envname()) << ".\n";
    if (!option->get_default_str().empty()) out << "Default: " << roff(option->get_default_str()) << ".\n";
  }
}

}  // namespace

std::string manual(const CLI::App& app) {
  std::ostringstream out;
  out << ".TH STRATA 1 \"\" \"strata " << kVersion << "\"\n.SH NAME\nstrata \\- all\\-hexahedral meshes with boundary layers\n"
      << ".SH SYNOPSIS\n.B strata\n.I COMMAND\n[options]\n.SH DESCRIPTION\n"
      << roff(app.get_description()) << "\n.SH COMMANDS\n";
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_group().empty()) continue;
    out << ".SS strata " << roff(command->get_name()) << "\n" << roff(command->get_description()) << "\n";
    add_options(*command, out);
  }
  out << ".SH OPTIONS OF EVERY COMMAND\n";
  add_options(app, out);
  out << ".SH EXIT STATUS\n";
  for (const Meaning& meaning : kMeanings) out << ".TP\n.B " << static_cast<int>(meaning.code) << "\n" << roff(meaning.text) << "\n";
  out << ".TP\n.B 128+n\nended by signal n\n";
  return out.str();
}

}  // namespace strata::client
