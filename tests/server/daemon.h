// A stratad of one's own, in a process of its own, and what it costs.
#pragma once

#include <grpcpp/grpcpp.h>
#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace strata::server {

// The long form of a load test: STRATA_LONG=1 (ctest -L long).
bool is_long();
// Sanitizers and loaded machines are slower; what a bound is about stays as it is on a quiet one.
double slowness();

class Daemon {
 public:
  // Ready on return. The folder, with the jobs of an earlier one when it is named, is removed by its maker.
  explicit Daemon(std::vector<std::string> flags = {}, std::string folder = {});
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  // A connection of its own.
  [[nodiscard]] std::shared_ptr<grpc::Channel> connect() const;
  [[nodiscard]] std::int64_t resident_bytes() const;
  [[nodiscard]] const std::string& folder() const { return folder_; }
  [[nodiscard]] std::chrono::duration<double> time_to_ready() const { return ready_after_; }
  void kill(int signal);

 private:
  std::string folder_;
  bool own_folder_ = false;
  pid_t pid_ = -1;
  std::chrono::duration<double> ready_after_{};
};

// The value below which this share of them lies.
double quantile(std::vector<double> values, double share);

}  // namespace strata::server
