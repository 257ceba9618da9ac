#include "server/config.h"

#include <sched.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>

namespace strata::server {
namespace {

void add_flags(CLI::App& app, Config& config) {
  const auto env = [](CLI::Option* option, const char* name) { return option->envname(name)->capture_default_str(); };
  app.set_config("--config", "", "Settings, one `name = value` a line, named like the flags", false)->envname("STRATAD_CONFIG");
  env(app.add_option("--listen", config.server.listen, "Address: host:port (port 0: any) or unix:/path; may be repeated"),
      "STRATAD_LISTEN");
  env(app.add_option("--data-dir,--data", config.data_folder, "Folder for surfaces, meshes and jobs"), "STRATAD_DATA_DIR");
  env(app.add_option("--slots", config.slots, "Jobs that run at once")->check(CLI::Range(1, 256)), "STRATAD_SLOTS");
  env(app.add_option("--cores,--threads", config.threads, "Threads of all jobs together; 0: the cores this process may use")
          ->check(CLI::Range(0, 1024)),
      "STRATAD_CORES");
  env(app.add_option("--queue", config.desk.queue_capacity, "Jobs that may wait")->check(CLI::Range(0, 1'000'000)), "STRATAD_QUEUE");
  env(app.add_option("--job-time-limit", config.desk.time_limit_seconds, "Seconds a job may run; 0: no limit")
          ->check(CLI::NonNegativeNumber),
      "STRATAD_JOB_TIME_LIMIT");
  env(app.add_option("--max-upload", config.server.limits.max_upload_bytes, "Largest surface, bytes")->check(CLI::PositiveNumber),
      "STRATAD_MAX_UPLOAD");
  env(app.add_option("--drain-timeout", config.drain_timeout_seconds, "Seconds running jobs get to finish after SIGTERM")
          ->check(CLI::NonNegativeNumber),
      "STRATAD_DRAIN_TIMEOUT");
  env(app.add_option("--tls-cert", config.server.tls.certificate, "Certificate chain, PEM"), "STRATAD_TLS_CERT");
  env(app.add_option("--tls-key", config.server.tls.key, "Private key, PEM"), "STRATAD_TLS_KEY");
  env(app.add_option("--tls-client-ca", config.server.tls.client_ca, "Clients must show a certificate signed by this CA, PEM"),
      "STRATAD_TLS_CLIENT_CA");
  app.add_flag("--insecure", config.server.insecure, "Allow addresses beyond loopback without TLS")->envname("STRATAD_INSECURE");
  env(app.add_option("--metrics-listen", config.metrics_listen, "host:port for Prometheus; empty: none"), "STRATAD_METRICS_LISTEN");
  env(app.add_option("--log-level", config.log_level, "What to log")
          ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"})),
      "STRATAD_LOG_LEVEL");
  app.add_flag("--exit-with-parent", config.exit_with_parent, "End when the process that started this one ends");
  app.add_option("--ready-fd", config.ready_fd, "File descriptor that gets the addresses when the server is ready");
  app.set_version_flag("--version", std::string("stratad ") + STRATA_VERSION);
}

// Quota of cgroup v2, in cores; 0: none.
double cgroup_quota() {
  std::ifstream file("/sys/fs/cgroup/cpu.max");
  std::string quota;
  double period = 0;
  if (!(file >> quota >> period) || quota == "max" || period <= 0) return 0;
  return std::atof(quota.c_str()) / period;
}

}  // namespace

int usable_cores() {
  cpu_set_t set;
  int cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
  const double quota = cgroup_quota();
  if (quota > 0) cores = std::min(cores, static_cast<int>(std::ceil(quota)));
  return std::max(cores, 1);
}

ParsedConfig parse_config(int argc, const char* const* argv) {
  Config config;
  CLI::App app{"stratad: meshes surfaces with hexahedra and boundary layers, over gRPC", "stratad"};
  add_flags(app, config);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return {{}, app.exit(error) == 0 ? 0 : 2};
  }
  if (config.threads == 0) config.threads = usable_cores();
  config.desk.threads_per_job = std::max(1, config.threads / config.slots);
  config.desk.generator = STRATA_VERSION;
  return {config, 0};
}

}  // namespace strata::server
