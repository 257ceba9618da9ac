// Where a worker was when it died: written by itself to stderr, read by the server.
#pragma once

#include <string>

namespace strata::server {

// From now on SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT write a backtrace to stderr and end the process with that signal; SIGUSR1
// writes one and goes on.
void report_crashes();

// What workers call themselves: argv[0], by which their own functions are told from those of libraries.
inline constexpr const char* kProgramName = "stratad";

// The calls of the last backtrace in what a worker wrote, names demangled, innermost first, one a line; empty: there is none. `program`: the file
// it ran, for the names of functions that it does not export; may be empty.
std::string backtrace_in(const std::string& written, const std::string& program);

}  // namespace strata::server
