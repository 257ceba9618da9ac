#include "tests/server/daemon.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "server/ids.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kStartLimit{60};

}  // namespace

bool is_long() { return std::getenv("STRATA_LONG") != nullptr; }

double slowness() {
  const char* factor = std::getenv("STRATA_TIME_FACTOR");
  return factor == nullptr ? 1 : std::atof(factor);
}

Daemon::Daemon(std::vector<std::string> flags, std::string folder) : folder_(std::move(folder)), own_folder_(folder_.empty()) {
  if (own_folder_) folder_ = (fs::temp_directory_path() / ("strata-load-" + random_id())).string();
  fs::create_directories(folder_);
  std::vector<std::string> words{STRATAD, "--listen", "unix:" + folder_ + "/socket", "--data-dir", folder_ + "/data", "--exit-with-parent"};
  words.insert(words.end(), flags.begin(), flags.end());
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, (folder_ + "/log").c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  fs::remove(folder_ + "/socket");
  const auto begun = std::chrono::steady_clock::now();
  const int failure = posix_spawn(&pid_, STRATAD, &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0) throw std::runtime_error("cannot start stratad");
  if (!connect()->WaitForConnected(std::chrono::system_clock::now() + kStartLimit)) throw std::runtime_error("stratad does not answer");
  ready_after_ = std::chrono::steady_clock::now() - begun;
}

Daemon::~Daemon() {
  kill(SIGKILL);
  if (own_folder_) fs::remove_all(folder_);
}

std::shared_ptr<grpc::Channel> Daemon::connect() const {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 20);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 20);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 20);
  return grpc::CreateCustomChannel("unix:" + folder_ + "/socket", grpc::InsecureChannelCredentials(), arguments);
}

std::int64_t Daemon::resident_bytes() const {
  std::ifstream statm("/proc/" + std::to_string(pid_) + "/statm");
  std::int64_t size = 0, resident = 0;
  statm >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

void Daemon::kill(int signal) {
  if (pid_ < 0) return;
  ::kill(pid_, signal);
  int status = 0;
  waitpid(std::exchange(pid_, -1), &status, 0);
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace strata::server
