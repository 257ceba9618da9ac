// How stratad is told what to do: flags, then STRATAD_* variables, then the file given by --config, then defaults.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/server.h"

namespace strata::server {

// Where jobs run.
enum class Isolation {
  Process,  // each in a process of its own
  Thread,   // in the server
};

struct Config {
  ServerOptions server;
  DeskOptions desk;
  std::string data_folder = "strata-data";
  std::string auth_file;               // who may do what; empty: everybody everything
  int slots = 1;                       // jobs at once
  int threads = 0;                     // of all jobs together; 0: the cores this process may use
  double drain_timeout_seconds = 300;  // for running jobs after SIGTERM
  Isolation isolation = Isolation::Process;
  std::int64_t memory_bytes = 0;       // of all running jobs together; 0: what is there
  std::string worker_program = "/proc/self/exe";
  Durability durability = Durability::PowerLoss;
  bool exit_with_parent = false;
  int ready_fd = -1;                   // gets the addresses, one a line, and is closed, when the server is ready
  bool check_only = false;
  std::string backup_to;               // empty: no backup
  std::string trace_file;              // empty: no traces
  int bundles = 20;                    // of failed jobs, kept for whoever looks into them
  std::string metrics_listen;          // host:port; empty: none
  std::string log_level = "info";
};

// What the command line asked for; or an exit code, after it printed help, the version or a complaint.
struct ParsedConfig {
  std::optional<Config> config;
  int exit_code = 0;
};
ParsedConfig parse_config(int argc, const char* const* argv);

// Settings of a file as (name, values): a YAML map, where maps inside join their names with '-' (tls: {cert: x} is tls-cert); or
// `name = value` lines. Throws std::runtime_error.
std::vector<std::pair<std::string, std::vector<std::string>>> settings_in(const std::string& text);

}  // namespace strata::server
