// Where a worker was when it died: written by itself to stderr, read by the server.
#pragma once

#include <string>

namespace strata::server {

// From now on SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT write a backtrace to stderr and end the process with that signal; SIGUSR1
// writes one and goes on.
void report_crashes();

// The calls of the last backtrace in what a worker wrote, names demangled, innermost first, one a line; empty: there is none.
std::string backtrace_in(const std::string& written);

}  // namespace strata::server
