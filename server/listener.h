// Listens on the server's addresses and hands what comes to gRPC, never more connections at once than a limit. gRPC 1.51 has no such limit of its
// own, and when it runs out of file descriptors it stops listening for good.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/child_process.h"

namespace strata::server {

// Has it the form host:port or unix:/path? Throws std::runtime_error with a sentence for the operator.
void check_address(const std::string& address);

class Listener {
 public:
  // Fewer than `most_connections` when the process may not open so many files.
  explicit Listener(int most_connections);
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  // host:port (port 0: any; a wildcard listens to both families) or unix:/path. To be called before the server is built. Throws
  // std::runtime_error with a sentence for the operator.
  void add(const std::string& address, grpc::ServerBuilder& builder, const std::shared_ptr<grpc::ServerCredentials>& credentials);
  // The addresses clients can use; ports filled in.
  [[nodiscard]] const std::vector<std::string>& addresses() const { return addresses_; }

  void start();
  // No new connections; the open ones are gRPC's.
  void stop();

 private:
  struct Door {
    Fd socket;
    std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor;
    std::string path;  // of a Unix socket
  };

  void serve(const std::stop_token& stop);
  void take(const Door& door);
  bool has_room();
  void tell_refusal();

  const std::size_t most_;
  Fd wake_;  // ends the wait for connections
  std::vector<Door> doors_;
  std::vector<std::string> addresses_;
  std::map<int, unsigned long> open_;  // file descriptor, inode of its socket
  std::chrono::steady_clock::time_point told_;  // of connections that were refused
  std::jthread thread_;
};

}  // namespace strata::server
