#include "server/listener.h"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace strata::server {
namespace {

constexpr rlim_t kFilesForOthers = 64;  // blobs, stores, pipes to workers: a quarter of what may be open, at least these
constexpr std::chrono::seconds kTellEvery{10};  // a flood must not fill the log
constexpr std::chrono::milliseconds kPause{100};  // when there are no more files

[[noreturn]] void cannot_listen(const std::string& address, const std::string& why) {
  throw std::runtime_error("cannot listen on " + address + ": " + why);
}

std::size_t connections_that_fit(int most) {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  if (files.rlim_cur == RLIM_INFINITY) return static_cast<std::size_t>(most);
  const rlim_t others = std::max(kFilesForOthers, files.rlim_cur / 4);
  return std::min(static_cast<std::size_t>(most), static_cast<std::size_t>(files.rlim_cur > others ? files.rlim_cur - others : 1));
}

Fd listening(const std::string& address, Fd socket, const sockaddr* at, socklen_t size) {
  if (socket.get() < 0 || bind(socket.get(), at, size) != 0 || listen(socket.get(), SOMAXCONN) != 0)
    cannot_listen(address, std::strerror(errno));
  return socket;
}

Fd new_socket(int family) { return Fd(socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)); }

constexpr std::string_view kUnix = "unix:";
constexpr std::size_t kLongestPath = sizeof(sockaddr_un::sun_path) - 1;
constexpr int kLastPort = 65535;

bool is_port(const std::string& text) {
  return !text.empty() && text.size() <= 5 && text.find_first_not_of("0123456789") == std::string::npos && std::stoi(text) <= kLastPort;
}

// What a server left that was killed may go; another file may not, and neither may the socket of one that still listens.
void remove_old_socket(const std::string& address, const sockaddr_un& at) {
  struct stat status{};
  if (stat(at.sun_path, &status) != 0 || !S_ISSOCK(status.st_mode)) return;
  const Fd visitor = new_socket(AF_UNIX);
  if (connect(visitor.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0 || errno == EAGAIN)
    cannot_listen(address, std::strerror(EADDRINUSE));
  unlink(at.sun_path);
}

Fd listen_unix(const std::string& address, const std::string& path) {
  sockaddr_un at{};
  at.sun_family = AF_UNIX;
  path.copy(at.sun_path, kLongestPath);
  remove_old_socket(address, at);
  return listening(address, new_socket(AF_UNIX), reinterpret_cast<const sockaddr*>(&at), sizeof at);
}

Fd listen_tcp(const std::string& address, const addrinfo& at) {
  Fd socket = new_socket(at.ai_family);
  const int yes = 1, no = 0;
  setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes,
             sizeof yes);  // not REUSEPORT: two servers on one port would share jobs by accident
  setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);  // connections inherit it
  if (at.ai_family == AF_INET6) setsockopt(socket.get(), IPPROTO_IPV6, IPV6_V6ONLY, &no, sizeof no);
  return listening(address, std::move(socket), at.ai_addr, at.ai_addrlen);
}

using Addresses = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

Addresses resolve(const std::string& address, const std::string& host, const std::string& port) {
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  wanted.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const int failure = getaddrinfo(host.c_str(), port.c_str(), &wanted, &found);
  if (failure != 0) cannot_listen(address, gai_strerror(failure));
  return {found, &freeaddrinfo};
}

Fd listen_tcp(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  const std::string port = address.substr(colon + 1);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  if (host == "0.0.0.0" || host == "::") {
    try {
      return listen_tcp(address, *resolve(address, "::", port));
    } catch (const std::runtime_error&) {
      host = "0.0.0.0";  // a machine without IPv6
    }
  }
  return listen_tcp(address, *resolve(address, host, port));
}

int port_of(const Fd& socket) {
  sockaddr_storage at{};
  socklen_t size = sizeof at;
  getsockname(socket.get(), reinterpret_cast<sockaddr*>(&at), &size);
  return ntohs(at.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(at).sin6_port
                                        : reinterpret_cast<const sockaddr_in&>(at).sin_port);
}

// Tells a socket from a later one with the same number; 0: closed.
unsigned long inode_of(int fd) {
  struct stat status{};
  return fstat(fd, &status) == 0 && S_ISSOCK(status.st_mode) ? status.st_ino : 0;
}

}  // namespace

void check_address(const std::string& address) {
  if (address.rfind(kUnix, 0) == 0) {
    const std::size_t size = address.size() - kUnix.size();
    if (size < 1 || size > kLongestPath) cannot_listen(address, "a path has 1 to " + std::to_string(kLongestPath) + " bytes");
    return;
  }
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0 || !is_port(address.substr(colon + 1)))
    cannot_listen(address, "an address is host:port, with a port up to " + std::to_string(kLastPort) + ", or unix:/path");
}

Listener::Listener(int most_connections) : most_(connections_that_fit(most_connections)), wake_(eventfd(0, EFD_CLOEXEC)) {}
Listener::~Listener() { stop(); }

void Listener::add(const std::string& address, grpc::ServerBuilder& builder, const std::shared_ptr<grpc::ServerCredentials>& credentials) {
  check_address(address);
  Door door;
  if (address.rfind(kUnix, 0) == 0) {
    door.path = address.substr(kUnix.size());
    door.socket = listen_unix(address, door.path);
    addresses_.push_back(address);
  } else {
    door.socket = listen_tcp(address);
    addresses_.push_back(address.substr(0, address.rfind(':') + 1) + std::to_string(port_of(door.socket)));
  }
  using Type = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
  door.acceptor = builder.experimental().AddExternalConnectionAcceptor(Type::FROM_FD, credentials);
  doors_.push_back(std::move(door));
}

void Listener::start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
}

void Listener::stop() {
  if (thread_.joinable()) {
    thread_.request_stop();
    eventfd_write(wake_.get(), 1);
    thread_.join();
  }
  for (const Door& door : doors_)
    if (!door.path.empty()) unlink(door.path.c_str());
  doors_.clear();
}

void Listener::serve(const std::stop_token& stop) {
  std::vector<pollfd> waiting;
  for (const Door& door : doors_) waiting.push_back({door.socket.get(), POLLIN, 0});
  waiting.push_back({wake_.get(), POLLIN, 0});
  while (!stop.stop_requested()) {
    if (poll(waiting.data(), waiting.size(), -1) <= 0) continue;
    for (std::size_t i = 0; i < doors_.size(); ++i)
      if (waiting[i].revents != 0) take(doors_[i]);
  }
}

// One that is too many is closed at once: its client knows and comes back.
void Listener::take(const Door& door) {
  Fd connection(accept4(door.socket.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
  if (connection.get() < 0) {
    if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) std::this_thread::sleep_for(kPause);
    return;
  }
  if (!has_room()) return;
  open_[connection.get()] = inode_of(connection.get());
  grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
  parameters.listener_fd = door.socket.get();
  parameters.fd = connection.release();
  door.acceptor->HandleNewConnection(&parameters);
}

// gRPC does not say when it closes one: that is looked up when it matters.
bool Listener::has_room() {
  if (open_.size() < most_) return true;
  std::erase_if(open_, [](const auto& one) { return inode_of(one.first) != one.second; });
  if (open_.size() < most_) return true;
  tell_refusal();
  return false;
}

void Listener::tell_refusal() {
  const auto now = std::chrono::steady_clock::now();
  if (now - told_ < kTellEvery) return;
  told_ = now;
  spdlog::warn(R"("msg":"connections are refused: there are too many","connections":{})", open_.size());
}

}  // namespace strata::server
