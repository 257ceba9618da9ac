// Following a job to its end, through lost connections.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "client/connection.h"
#include "client/progress.h"

namespace strata::client {

// Set by SIGINT and SIGTERM; watching ends soon after with CommandError(130).
extern std::atomic<int> interrupted;
void catch_signals();

struct WatchOptions {
  int retries = 8;
  double limit_seconds = 0;                                   // 0: none; then CommandError(Timeout), the job goes on
  std::function<void(const v1::WatchJobResponse&)> on_event;  // every event with a sequence, for machine output
};

// Returns the job when it has ended, however.
v1::Job watch(Connection& connection, const std::string& job_id, const WatchOptions& options, ProgressView& view);

}  // namespace strata::client
