// stratad: wires the parts, starts, waits for the signal, drains.
#include <fcntl.h>
#include <grpc/grpc.h>
#include <malloc.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>

#include "server/bundles.h"
#include "server/call_watch.h"
#include "server/config.h"
#include "server/job_log.h"
#include "server/library_log.h"
#include "server/listener.h"
#include "server/metrics.h"
#include "server/worker.h"

namespace {

using namespace strata::server;

// Messages of 1 MiB come and go: with stock thresholds each one costs fresh pages from the kernel (about a third of the throughput).
void keep_memory_between_messages() {
  mallopt(M_MMAP_THRESHOLD, 256 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  mallopt(M_TOP_PAD, 64 << 20);
}

// Each connection, upload and worker takes one; many systems begin with 1024.
void allow_many_files() {
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0) return;
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);
}

// Held until the process ends: whoever gives gRPC 1.51 back last waits for one of its own pollers, which may sleep for ten more seconds.
void keep_grpc() { grpc_init(); }

// Blocked here and so in every thread started later; read in wait_for_signal.
sigset_t block_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGINT);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  return set;
}

int wait_for_signal(const sigset_t& set) {
  int signal = 0;
  sigwait(&set, &signal);
  return signal;
}

// The parent to follow; SIGTERM comes when it ends. Empty when it ended meanwhile.
std::optional<pid_t> follow_parent() {
  const pid_t parent = getppid();
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) return {};
  return parent;
}

void tell_ready(int fd, const std::vector<std::string>& addresses) {
  if (fd < 0) return;
  std::string text;
  for (const std::string& address : addresses) text += address + "\n";
  if (write(fd, text.data(), text.size()) != static_cast<ssize_t>(text.size())) spdlog::warn("cannot write to --ready-fd");
  close(fd);
}

// Waits for running jobs; a second signal ends the wait, and so does a parent that is no more: nobody will fetch the mesh.
void drain(const Config& config, pid_t parent, Server& server, JobDesk& desk, const sigset_t& signals) {
  server.set_not_serving();
  desk.drain();
  if (config.exit_with_parent && getppid() != parent) return;
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(config.drain_timeout_seconds);
  constexpr timespec kLook{0, 20'000'000};
  while (!desk.wait_idle(std::chrono::milliseconds(0)) && std::chrono::steady_clock::now() < until)
    if (sigtimedwait(&signals, nullptr, &kLook) > 0) return;
}

// Two servers in one folder would run each other's jobs. Held until the process ends, however it does.
class DataLock {
 public:
  explicit DataLock(const std::string& folder) {
    // Surfaces, meshes, names: a folder made here is for nobody else. One that was there has the owner and mode somebody gave it.
    if (std::filesystem::create_directories(folder)) std::filesystem::permissions(folder, std::filesystem::perms::owner_all);
    const std::string path = folder + "/lock";
    fd_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (fd_ < 0) throw std::runtime_error("cannot open " + path + ": " + std::strerror(errno));
    // A lock of the process, not of the file (flock): a worker that is just being spawned has a copy of the file for a moment, and would keep
    // the folder from the next server if this one were killed then.
    struct flock whole{};
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    if (fcntl(fd_, F_SETLK, &whole) != 0) throw std::runtime_error("another stratad uses " + folder);
  }
  ~DataLock() { close(fd_); }
  DataLock(const DataLock&) = delete;
  DataLock& operator=(const DataLock&) = delete;

 private:
  int fd_ = -1;
};

void serve(const Config& config, pid_t parent, const sigset_t& signals) {
  const DataLock lock(config.data_folder);
  Gate gate(config.auth_file);
  const auto blobs = open_file_blob_store(config.data_folder, config.durability);
  const auto jobs = open_job_store(config.data_folder, config.durability);
  const MesherDoor mesher = mesher_door();
  MemoryLedger memory(config.memory_bytes);
  const bool threads = config.isolation == Isolation::Thread;
  const auto runner = threads ? make_thread_runner(config.slots, *blobs, memory, mesher)
                              : make_process_runner({config.slots, config.worker_program}, *blobs, memory);
  const auto checker =
      threads ? make_thread_checker(*blobs, mesher, config.memory_bytes) : make_process_checker(config.worker_program, *blobs, memory);
  const auto keeping = keep_bundles(*runner, *blobs, {config.data_folder + "/bundles", config.bundles, config.desk.generator});
  const auto logged = log_jobs(*keeping);
  Metrics metrics;
  Tracer tracer(config.trace_file);
  const auto traced = trace_jobs(*logged, tracer);
  const auto measured = metrics.measure(*traced);
  DeskOptions options = config.desk;
  options.limits_of = [&gate](const std::string& tenant) { return gate.limits_of(tenant); };
  options.on_unrun = [&metrics](const strata::v1::Job& job) {
    log_end(job.job_id(), job);
    metrics.count_unrun(job);
  };
  JobDesk desk(*jobs, *blobs, *measured, *checker, mesher, options);
  Server server(config.server, watch_calls(metrics, tracer), gate, desk, *blobs);
  if (!config.metrics_listen.empty()) metrics.serve(config.metrics_listen, desk, memory);
  for (const std::string& address : server.addresses())
    spdlog::info(R"("msg":"listening","address":"{}","slots":{},"threads_per_job":{})", address, config.slots, config.desk.threads_per_job);
  tell_ready(config.ready_fd, server.addresses());
  const int signal = wait_for_signal(signals);
  spdlog::info(R"("msg":"draining","signal":{})", signal);
  drain(config, parent, server, desk, signals);
  constexpr std::chrono::milliseconds kGrace{500};  // for answers under way
  server.shutdown(kGrace);
  metrics.stop();
  spdlog::info(R"("msg":"stopped")");
}

void must_be_writable(const std::filesystem::path& place, const std::string& path, const char* flag) {
  if (access(place.c_str(), W_OK) != 0) throw std::runtime_error("cannot write " + path + " (" + flag + "): " + std::strerror(errno));
}

void check_data_folder(const std::string& path) {
  std::filesystem::path place = std::filesystem::absolute(path);
  while (!std::filesystem::exists(place)) place = place.parent_path();
  if (!std::filesystem::is_directory(place)) throw std::runtime_error(path + " (--data-dir) is no folder");
  must_be_writable(place, path, "--data-dir");
}

void check_trace_file(const std::string& path) {
  const std::filesystem::path file = std::filesystem::absolute(path);
  if (std::filesystem::is_directory(file)) throw std::runtime_error(path + " (--trace-file) is a folder");
  must_be_writable(std::filesystem::exists(file) ? file : file.parent_path(), path, "--trace-file");
}

// What the settings come to; what is wrong is thrown.
int check(const Config& config) {
  check_options(config.server);
  check_data_folder(config.data_folder);
  if (!config.trace_file.empty()) check_trace_file(config.trace_file);
  if (!config.metrics_listen.empty()) check_address(config.metrics_listen);
  const Gate gate(config.auth_file);
  std::cout << "listen: [";
  for (const std::string& address : config.server.listen) std::cout << (&address == &config.server.listen.front() ? "" : ", ") << address;
  std::cout << "]\ndata-dir: " << config.data_folder << "\nslots: " << config.slots << "\ncores: " << config.threads
            << "\nthreads per job: " << config.desk.threads_per_job << "\nmemory: " << config.memory_bytes
            << "\nisolation: " << (config.isolation == Isolation::Process ? "process" : "thread")
            << "\nmax cells: " << config.desk.admission.max_cells << "\nqueue: " << config.desk.queue_capacity
            << "\nresult-ttl: " << config.desk.result_ttl_seconds << "\nauth: " << (gate.open() ? "none" : config.auth_file) << "\n";
  return 0;
}

int back_up(const Config& config) {
  back_up_job_store(config.data_folder, config.backup_to);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (is_worker(argc, argv)) return worker_main(mesher_door(), argv);
  allow_many_files();
  keep_memory_between_messages();
  keep_grpc();
  const ParsedConfig parsed = parse_config(argc, argv);
  if (!parsed.config) return parsed.exit_code;
  const Config& config = *parsed.config;
  const sigset_t signals = block_signals();
  const std::optional<pid_t> parent = config.exit_with_parent ? follow_parent() : getppid();
  if (!parent) return 0;
  spdlog::set_default_logger(spdlog::stderr_logger_mt("stratad"));
  spdlog::set_pattern(R"({"ts":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})");
  spdlog::set_level(spdlog::level::from_str(config.log_level));
  take_library_logs();
  try {
    if (config.check_only) return check(config);
    if (!config.backup_to.empty()) return back_up(config);
    serve(config, *parent, signals);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "stratad: " << error.what() << "\n";
    return config.check_only ? 2 : 1;
  }
}
