#include "server/config.h"

#include <yaml-cpp/yaml.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include "server/machine.h"

namespace strata::server {
namespace {

const std::map<std::string, double> kTimeUnits{{"s", 1}, {"min", 60}, {"h", 3600}, {"d", 86400}};
constexpr double kDefaultResultTtl = 7 * 86400;
constexpr std::int64_t kDefaultDiskReserve = std::int64_t{512} << 20;
constexpr int kMaxStartsInThreads = 10;  // a job that ends the server each time must not be started for ever
constexpr double kDefaultTimeLimit = 86400;  // seconds: a loop without end must end

using Settings = std::vector<std::pair<std::string, std::vector<std::string>>>;

void add_settings(const YAML::Node& map, const std::string& prefix, Settings& settings) {
  for (const auto& entry : map) {
    const std::string name = prefix + entry.first.as<std::string>();
    const YAML::Node& value = entry.second;
    if (value.IsMap()) {
      add_settings(value, name + "-", settings);
      continue;
    }
    std::vector<std::string> values;
    if (value.IsScalar()) values.push_back(value.as<std::string>());
    for (std::size_t i = 0; value.IsSequence() && i < value.size(); ++i) values.push_back(value[i].as<std::string>());
    settings.emplace_back(name, std::move(values));
  }
}

Settings lines_in(const std::string& text) {
  std::istringstream stream(text);
  Settings settings;
  for (const CLI::ConfigItem& item : CLI::ConfigTOML().from_config(stream))
    if (item.name != "++" && item.name != "--") settings.emplace_back(item.fullname(), item.inputs);
  return settings;
}

// STRATAD_DATA_DIR for data-dir.
std::string variable_of(const std::string& name) {
  std::string variable = "STRATAD_";
  for (const char c : name) variable += c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return variable;
}

// What --config accepts, for CLI11.
class ConfigFile final : public CLI::ConfigTOML {
 public:
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    std::ostringstream text;
    text << input.rdbuf();
    std::vector<CLI::ConfigItem> found;
    try {
      for (auto& [name, values] : settings_in(text.str())) {
        if (std::getenv(variable_of(name).c_str()) != nullptr) continue;  // the environment beats the file
        found.emplace_back();
        found.back().name = name;
        found.back().inputs = std::move(values);
      }
    } catch (const std::exception& error) {
      throw CLI::ConfigError(std::string("the file given by --config cannot be read: ") + error.what());
    }
    return found;
  }
};

void add_flags(CLI::App& app, Config& config) {
  const auto env = [](CLI::Option* option, const char* name) { return option->envname(name)->capture_default_str(); };
  app.set_config("--config", "", "File with settings named like the flags: YAML, or one `name = value` a line")->envname("STRATAD_CONFIG");
  app.config_formatter(std::make_shared<ConfigFile>());
  app.allow_config_extras(CLI::config_extras_mode::error);
  env(app.add_option("--listen", config.server.listen, "Address: host:port (port 0: any) or unix:/path; may be repeated"),
      "STRATAD_LISTEN");
  env(app.add_option("--data-dir,--data", config.data_folder, "Folder for surfaces, meshes and jobs"), "STRATAD_DATA_DIR");
  env(app.add_option("--slots", config.slots, "Jobs that run at once")->check(CLI::Range(1, 256)), "STRATAD_SLOTS");
  env(app.add_option("--cores,--threads", config.threads, "Threads of all jobs together; 0: the cores this process may use")
          ->check(CLI::Range(0, 1024)),
      "STRATAD_CORES");
  env(app.add_option("--isolation", config.isolation, "Where jobs run: each in a process of its own, or in threads of the server")
          ->transform(
              CLI::CheckedTransformer(std::map<std::string, Isolation>{{"process", Isolation::Process}, {"thread", Isolation::Thread}})
                  .description("process or thread"))
          ->default_str("process"),
      "STRATAD_ISOLATION");
  env(app.add_option("--memory", config.memory_bytes, "Memory of all running jobs together, such as 8GiB; 0: what is there")
          ->transform(CLI::AsSizeValue(false)),
      "STRATAD_MEMORY");
  app.add_option("--worker-program", config.worker_program)->group("");
  env(app.add_option("--queue", config.desk.queue_capacity, "Jobs that may wait")->check(CLI::Range(0, 1'000'000)), "STRATAD_QUEUE");
  env(app.add_option("--max-watches", config.desk.max_watchers, "Watches at once")->check(CLI::Range(1, 1'000'000)), "STRATAD_MAX_WATCHES");
  env(app.add_option("--max-cells", config.desk.admission.max_cells, "Cells of a job's octree; larger ones are coarsened; 0: no limit")
          ->check(CLI::NonNegativeNumber),
      "STRATAD_MAX_CELLS");
  env(app.add_option("--job-time-limit", config.desk.time_limit_seconds, "Seconds a job may run; 0: no limit")
          ->check(CLI::NonNegativeNumber),
      "STRATAD_JOB_TIME_LIMIT");
  env(app.add_option("--max-upload", config.server.limits.max_upload_bytes, "Largest surface, bytes")->check(CLI::PositiveNumber),
      "STRATAD_MAX_UPLOAD");
  env(app.add_option("--max-connections", config.server.max_connections, "Connections at once; more are closed as they come")
          ->check(CLI::Range(1, 1'000'000)),
      "STRATAD_MAX_CONNECTIONS");
  env(app.add_option("--max-transfers", config.server.max_transfers, "Uploads and downloads at once")->check(CLI::Range(1, 1'000'000)),
      "STRATAD_MAX_TRANSFERS");
  env(app.add_option("--stall-timeout", config.server.stall_seconds, "Seconds after which uploads and downloads end whose clients stopped")
          ->check(CLI::Range(1.0, 86'400.0)),
      "STRATAD_STALL_TIMEOUT");
  env(app.add_option("--drain-timeout", config.drain_timeout_seconds, "Seconds running jobs get to finish after SIGTERM")
          ->check(CLI::NonNegativeNumber),
      "STRATAD_DRAIN_TIMEOUT");
  env(app.add_option("--tls-cert", config.server.tls.certificate, "Certificate chain, PEM"), "STRATAD_TLS_CERT");
  env(app.add_option("--tls-key", config.server.tls.key, "Private key, PEM"), "STRATAD_TLS_KEY");
  env(app.add_option("--tls-client-ca", config.server.tls.client_ca, "Clients must show a certificate signed by this CA, PEM"),
      "STRATAD_TLS_CLIENT_CA");
  env(app.add_option("--auth", config.auth_file, "File that says who may do what (YAML, docs/deploy.md); empty: everybody everything"),
      "STRATAD_AUTH");
  env(app.add_option("--result-ttl", config.desk.result_ttl_seconds,
                     "How long ended jobs and their results stay, such as 7d; 0: until deleted")
          ->transform(CLI::AsNumberWithUnit(kTimeUnits, CLI::AsNumberWithUnit::CASE_SENSITIVE, "DURATION")),
      "STRATAD_RESULT_TTL");
  env(app.add_option("--surface-ttl", config.desk.surface_ttl_seconds, "How long surfaces stay that no job uses; 0: for ever")
          ->transform(CLI::AsNumberWithUnit(kTimeUnits, CLI::AsNumberWithUnit::CASE_SENSITIVE, "DURATION")),
      "STRATAD_SURFACE_TTL");
  env(app.add_option("--disk-reserve", config.desk.disk_reserve_bytes, "No new jobs when less disk is free")
          ->transform(CLI::AsSizeValue(false)),
      "STRATAD_DISK_RESERVE");
  env(app.add_option("--tls-refresh", config.server.tls.refresh_seconds, "Seconds between looks at the certificate files")
          ->check(CLI::Range(1, 86400)),
      "STRATAD_TLS_REFRESH");
  env(app.add_option("--bundles", config.bundles,
                     "Jobs that ended with an internal error to keep in DATA-DIR/bundles, to be run again; 0: none")
          ->check(CLI::Range(0, 10'000)),
      "STRATAD_BUNDLES");
  app.add_flag("--check-config", config.check_only,
               "Say what the settings come to, and end: 0 when a server could start with them, else 2");
  app.add_option("--backup", config.backup_to, "Copy the job store to this file, also while a server runs, and end")->type_name("FILE");
  env(app.add_option("--trace-file", config.trace_file, "File that gets spans as lines of OTLP JSON; empty: none"), "STRATAD_TRACE_FILE");
  app.add_flag("--insecure", config.server.insecure, "Allow addresses beyond loopback without TLS")->envname("STRATAD_INSECURE");
  env(app.add_option("--metrics-listen", config.metrics_listen, "host:port for Prometheus; empty: none"), "STRATAD_METRICS_LISTEN");
  env(app.add_option("--log-level", config.log_level, "What to log")
          ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"})),
      "STRATAD_LOG_LEVEL");
  app.add_flag_callback(
      "--volatile", [&config] { config.durability = Durability::Process; },
      "Do not wait for the disk: nothing needs to outlive the machine, as in a private server");
  app.add_flag("--exit-with-parent", config.exit_with_parent, "End when the process that started this one ends");
  app.add_option("--ready-fd", config.ready_fd, "File descriptor that gets the addresses when the server is ready");
  app.set_version_flag("--version", std::string("stratad ") + STRATA_VERSION);
}

}  // namespace

Settings settings_in(const std::string& text) {
  const YAML::Node root = [&] {
    try {
      return YAML::Load(text);
    } catch (const YAML::Exception& error) {
      // `listen = [a, b]` is no YAML; a map with a mistake is no list of such lines either.
      if (text.find('=') == std::string::npos) throw;
      return YAML::Node();
    }
  }();
  Settings settings;
  if (!root.IsMap()) return lines_in(text);
  add_settings(root, "", settings);
  return settings;
}

ParsedConfig parse_config(int argc, const char* const* argv) {
  Config config;
  config.desk.time_limit_seconds = kDefaultTimeLimit;
  config.desk.result_ttl_seconds = kDefaultResultTtl;
  config.desk.disk_reserve_bytes = kDefaultDiskReserve;
  CLI::App app{"stratad: meshes surfaces with hexahedra and boundary layers, over gRPC", "stratad"};
  add_flags(app, config);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return {{}, app.exit(error) == 0 ? 0 : 2};
  }
  if (config.threads == 0) config.threads = usable_cores();
  if (config.memory_bytes == 0) config.memory_bytes = usable_memory();
  config.desk.threads_per_job = std::max(1, config.threads / config.slots);
  config.desk.generator = STRATA_VERSION;
  config.desk.admission.memory_budget_bytes = config.memory_bytes;
  config.desk.admission.threads = config.desk.threads_per_job;
  if (config.isolation == Isolation::Thread) config.desk.max_starts = kMaxStartsInThreads;
  return {config, 0};
}

}  // namespace strata::server
