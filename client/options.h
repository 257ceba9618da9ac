// The command line as values.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace strata::client {

enum class Output { Table, Json, Name };

enum class Packing {
  Auto,    // unless the server is on this machine
  Always,
  Never,
};

struct GlobalOptions {
  std::string server;           // address; empty: a private server for the time of the command
  std::string tls_ca, tls_cert, tls_key, server_name;
  std::string token_file;       // holds the token or key that says who calls; empty: none
  double timeout_seconds = 0;   // of the whole command; 0: none
  int retries = 8;
  Output output = Output::Table;
  Packing packing = Packing::Auto;  // of what is sent and received
  bool quiet = false;
  bool no_progress = false;
  int threads = 0;              // of the job; 0: what the server gives
};

struct MeshOptions {
  std::string surface;
  std::string spec;             // file; empty: defaults
  std::string out;
  std::string report;           // file; empty: none
  std::string layers_out;       // .sol or .solb; empty: none
  std::vector<std::string> formats;  // of submit: vtu, vtk, mesh, meshb, sol, solb, blocks
  bool cancel_on_exit = false;
  std::string request_id;       // empty: a new one
  std::string name;             // of the job, for people; empty: that of the surface
  std::vector<std::string> labels;   // KEY=VALUE
  int priority = 0;
  double keep_seconds = 0;      // of the results; 0: what the server gives
};

struct JobOptions {
  std::vector<std::string> jobs;
  std::string out;
  std::string format;
  std::string report;
  std::vector<std::string> states;
  std::vector<std::string> labels;   // KEY=VALUE
  bool force = false;
  bool any_end = false;         // wait: failed and cancelled count as well
};

}  // namespace strata::client
