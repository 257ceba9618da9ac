#include "client/connection.h"

#include <fcntl.h>
#include <grpcpp/grpcpp.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>
#include <cstdlib>

#include <cctype>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "client/exit_code.h"
#include "client/headers.h"
#include "client/interrupt.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX declares it nowhere

namespace strata::client {
namespace {

namespace fs = std::filesystem;

constexpr auto kStartLimit = std::chrono::seconds(20);
constexpr auto kStopLimit = std::chrono::seconds(10);
constexpr auto kKillLimit = std::chrono::seconds(2);
constexpr auto kConnectLimit = std::chrono::seconds(5);
// What may be repeated without harm is, below the retries of the commands; streams go on where they stopped by themselves.
constexpr const char* kServiceConfig = R"({"methodConfig": [{
  "name": [{"service": "strata.v1.SystemService"},
           {"service": "strata.v1.JobService", "method": "GetJob"}, {"service": "strata.v1.JobService", "method": "ListJobs"},
           {"service": "strata.v1.JobService", "method": "CreateJob"}, {"service": "strata.v1.JobService", "method": "CancelJob"},
           {"service": "strata.v1.JobService", "method": "ValidateJob"},
           {"service": "strata.v1.BlobService", "method": "GetUpload"}, {"service": "strata.v1.BlobService", "method": "GetBlob"}],
  "retryPolicy": {"maxAttempts": 3, "initialBackoff": "0.1s", "maxBackoff": "1s", "backoffMultiplier": 2,
                  "retryableStatusCodes": ["UNAVAILABLE"]}}],
  "retryThrottling": {"maxTokens": 20, "tokenRatio": 0.5}})";
constexpr std::chrono::milliseconds kLook{20};  // between looks at interrupts
constexpr int kReadyFd = 3;           // of the private server
constexpr std::size_t kLogTail = 2000;  // bytes of the private server's log in messages

// stratad lies beside this program; else it is sought on PATH.
std::string server_binary() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (!error && fs::exists(self.parent_path() / "stratad", error)) return (self.parent_path() / "stratad").string();
  return "stratad";
}

std::string read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

std::string pem(const std::string& path, const char* what) {
  std::string text = read_file(path);
  if (text.empty()) throw CommandError(ExitCode::Usage, std::string(what) + " '" + path + "' cannot be read or is empty");
  return text;
}

// Never on the command line, where everybody on the machine could read it.
std::string token(const GlobalOptions& options) {
  if (options.token_file.empty()) return {};
  std::string text = read_file(options.token_file);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.pop_back();
  if (text.empty()) throw CommandError(ExitCode::Usage, "the token file '" + options.token_file + "' cannot be read or is empty");
  return text;
}

std::shared_ptr<grpc::ChannelCredentials> credentials(const GlobalOptions& options) {
  if (options.tls_ca.empty() && options.tls_cert.empty()) return grpc::InsecureChannelCredentials();
  grpc::SslCredentialsOptions ssl;
  if (!options.tls_ca.empty()) ssl.pem_root_certs = pem(options.tls_ca, "the CA certificate");
  if (!options.tls_cert.empty()) {
    ssl.pem_cert_chain = pem(options.tls_cert, "the client certificate");
    ssl.pem_private_key = pem(options.tls_key, "the client key");
  }
  return grpc::SslCredentials(ssl);
}

// On one machine packing costs more than it saves.
bool packs(Packing packing, const std::string& address) {
  if (packing != Packing::Auto) return packing == Packing::Always;
  const bool here = address.rfind("unix:", 0) == 0 || address.rfind("localhost:", 0) == 0 || address.rfind("127.", 0) == 0 ||
                    address.rfind("[::1]:", 0) == 0;
  return !here;
}

bool wait_until_ready(grpc::Channel& channel, const PrivateServer* own, int retries) {
  using Clock = std::chrono::system_clock;
  const auto until = Clock::now() + (own != nullptr ? kStartLimit : kConnectLimit);
  // gRPC tries again a tenth of a second after it failed: better not to try too early.
  while (own != nullptr && Clock::now() < until && !own->said_something(kLook)) go_on();
  int failures = 0;
  while (Clock::now() < until && failures <= retries) {
    go_on();
    const grpc_connectivity_state state = channel.GetState(true);
    if (state == GRPC_CHANNEL_READY) return true;
    if (own != nullptr && !own->running()) return false;
    const bool changed = channel.WaitForStateChange(state, std::min(until, Clock::now() + kLook));
    if (own == nullptr && changed && channel.GetState(false) == GRPC_CHANNEL_TRANSIENT_FAILURE) ++failures;
  }
  return false;
}

}  // namespace

PrivateServer::PrivateServer(int threads) {
  std::string pattern = (fs::temp_directory_path() / "strata-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr)
    throw CommandError(ExitCode::LocalIo, "no temporary directory can be made in " + fs::temp_directory_path().string(),
                       "set TMPDIR to a directory that can be written");
  directory_ = pattern;
  address_ = "unix:" + directory_ + "/socket";
  std::vector<std::string> words{server_binary(),
                                 "--listen",
                                 address_,
                                 "--data",
                                 directory_ + "/data",
                                 "--slots",
                                 "1",
                                 "--drain-timeout",
                                 "0",
                                 "--exit-with-parent",
                                 "--volatile",
                                 "--ready-fd",
                                 std::to_string(kReadyFd)};
  if (threads > 0) {
    words.emplace_back("--threads");
    words.push_back(std::to_string(threads));
  }
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  int ready[2] = {-1, -1};
  if (pipe2(ready, O_CLOEXEC) == 0) posix_spawn_file_actions_adddup2(&actions, ready[1], kReadyFd);
  ready_ = ready[0];
  const std::string log_path = directory_ + "/log";
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  // Its own process group: Ctrl-C reaches the client, which then stops the server in order.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  const int failure = posix_spawnp(&pid_, words.front().c_str(), &actions, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  close(ready[1]);
  if (failure != 0) {
    pid_ = -1;
    close(ready_);
    fs::remove_all(directory_);
    throw CommandError(ExitCode::LocalIo, "stratad cannot be started: " + std::string(strerror(failure)),
                       "install stratad beside strata or on PATH, or name a server with --server");
  }
}

bool PrivateServer::said_something(std::chrono::milliseconds patience) const {
  pollfd ready{ready_, POLLIN, 0};
  return poll(&ready, 1, static_cast<int>(patience.count())) > 0;
}

PrivateServer::~PrivateServer() {
  close(ready_);
  if (pid_ > 0) {
    kill(pid_, SIGTERM);
    auto until = std::chrono::steady_clock::now() + kStopLimit;
    int signal = SIGTERM;  // once more, then without mercy
    int status = 0;
    while (waitpid(pid_, &status, WNOHANG) == 0) {
      if (std::chrono::steady_clock::now() > until) {
        kill(pid_, std::exchange(signal, SIGKILL));
        until += kKillLimit;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  std::error_code ignored;
  fs::remove_all(directory_, ignored);
}

std::string PrivateServer::log() const {
  const std::string text = read_file(directory_ + "/log");
  return text.size() > kLogTail ? "..." + text.substr(text.size() - kLogTail) : text;
}

bool PrivateServer::running() const {
  siginfo_t info{};
  // WNOWAIT leaves the process to be reaped by the destructor.
  return waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == 0;
}

Connection connect(const GlobalOptions& options, PrivateServerAllowed may_start) {
  Connection connection;
  connection.address = options.server;
  if (options.server.empty()) {
    if (may_start == PrivateServerAllowed::No)
      throw CommandError(ExitCode::Usage, "this command needs a server", "name one with --server ADDRESS or STRATA_SERVER");
    connection.own = std::make_unique<PrivateServer>(options.threads);
    connection.address = connection.own->address();
  }
  connection.packs = packs(options.packing, connection.address);
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(8 << 20);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 30000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 20000);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, connection.own ? 20 : 200);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, connection.own ? 50 : 10000);
  if (!options.server_name.empty()) arguments.SetSslTargetNameOverride(options.server_name);
  arguments.SetServiceConfigJSON(kServiceConfig);
  connection.channel = grpc::experimental::CreateCustomChannelWithInterceptors(connection.address, credentials(options), arguments,
                                                                               add_headers(token(options)));
  if (!wait_until_ready(*connection.channel, connection.own.get(), options.retries)) {
    if (connection.own) throw CommandError(ExitCode::Unreachable, "the private stratad did not start:\n" + connection.own->log());
    throw CommandError(ExitCode::Unreachable, "no answer from the server at " + connection.address,
                       "check the address, and that stratad runs: strata server status --server " + connection.address);
  }
  connection.jobs = v1::JobService::NewStub(connection.channel);
  connection.blobs = v1::BlobService::NewStub(connection.channel);
  connection.system = v1::SystemService::NewStub(connection.channel);
  return connection;
}

}  // namespace strata::client
