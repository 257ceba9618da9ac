// Prometheus: what the server did and does.
#pragma once

#include <memory>
#include <string>

#include "server/job_desk.h"
#include "server/job_runner.h"

namespace strata::server {

class Metrics {
 public:
  Metrics();
  ~Metrics();

  // Counts what passes through the runner. The result must not outlive `runner` or this.
  std::unique_ptr<JobRunner> measure(JobRunner& runner);
  // A job that ended without a runner.
  void count_unrun(const v1::Job& job);
  // A call of a service, such as "JobService/GetJob".
  void call_began(const std::string& rpc);
  void call_ended(const std::string& rpc, const std::string& code, double seconds);
  // A call that was refused, and why: a reason of the service's own, such as QUEUE_FULL.
  void call_refused(const std::string& rpc, const std::string& reason);
  // Serves /metrics on host:port; the load is that of `desk`, which must live until stop(). Throws std::runtime_error.
  void serve(const std::string& address, const JobDesk& desk, const MemoryLedger& memory);
  void stop();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace strata::server
