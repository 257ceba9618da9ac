// The gRPC server around the parts: addresses, credentials, limits, services.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "server/services.h"
#include "server/tls_files.h"

namespace strata::server {

struct ServerOptions {
  std::vector<std::string> listen = {"127.0.0.1:50051"};  // host:port (port 0: any) or unix:/path
  TlsFiles tls;
  bool insecure = false;    // allow TCP beyond loopback without TLS
  int max_connections = 4096;
  int max_transfers = 2048;    // uploads and downloads at once
  double stall_seconds = 120;  // after which a transfer ends whose client neither takes nor sends
  WireLimits limits;
};

// Could a server start with these? Throws std::runtime_error with a sentence for the operator.
void check_options(const ServerOptions& options);

// Throws std::runtime_error with a sentence for the operator.
class Server {
 public:
  using CallWatchers = std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>>;
  Server(const ServerOptions& options, CallWatchers watchers, Gate& gate, JobDesk& desk, BlobStore& blobs);
  ~Server();

  // The addresses clients can use; ports filled in.
  [[nodiscard]] const std::vector<std::string>& addresses() const;
  // Health says NOT_SERVING from now on; calls still work.
  void set_not_serving();
  // Ends what is open after `grace`.
  void shutdown(std::chrono::milliseconds grace);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// Is this address reachable from this machine only?
bool is_local(const std::string& address);

}  // namespace strata::server
