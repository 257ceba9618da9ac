// The way to a server: one that runs somewhere, or a private one for the time of the command.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <memory>
#include <string>

#include "client/options.h"
#include "strata/v1/blob.grpc.pb.h"
#include "strata/v1/job.grpc.pb.h"
#include "strata/v1/system.grpc.pb.h"

namespace strata::client {

// A stratad on a Unix socket in a fresh directory of its own. The destructor stops it and waits for it, so that its CPU time and peak
// memory count among the children of this process.
class PrivateServer {
 public:
  // Throws CommandError(LocalIo) when stratad is not found or does not start. `threads` 0: all cores.
  explicit PrivateServer(int threads);
  ~PrivateServer();
  PrivateServer(const PrivateServer&) = delete;
  PrivateServer& operator=(const PrivateServer&) = delete;
  [[nodiscard]] const std::string& address() const { return address_; }
  // What the server said on its standard error so far, for messages when it died.
  [[nodiscard]] std::string log() const;
  [[nodiscard]] bool running() const;
  // Waits so long for word that it is ready; true when there is some, or never will be.
  [[nodiscard]] bool said_something(std::chrono::milliseconds patience) const;

 private:
  std::string directory_;
  std::string address_;
  pid_t pid_ = -1;
  int ready_ = -1;  // has something to read when the server is ready, and ends with it
};

struct Connection {
  std::string address;
  bool packs = false;                   // what is sent and received, where the server can
  std::unique_ptr<PrivateServer> own;   // when the server is private
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::JobService::Stub> jobs;
  std::unique_ptr<v1::BlobService::Stub> blobs;
  std::unique_ptr<v1::SystemService::Stub> system;
};

// Connects to options.server, or starts a private server when that is empty and `may_start` holds. Waits until the server answers.
// Throws CommandError(Unreachable, Usage).
enum class PrivateServerAllowed { No, Yes };
Connection connect(const GlobalOptions& options, PrivateServerAllowed may_start);

}  // namespace strata::client
