// Following a job to its end, through lost connections.
#pragma once

#include <functional>
#include <string>

#include "client/connection.h"
#include "client/progress.h"

namespace strata::client {

struct WatchOptions {
  int retries = 8;
  std::function<void(const v1::WatchJobResponse&)> on_event;  // every event once, snapshots and heartbeats apart
};

// Returns the job when it has ended, however. Throws as go_on does when the command should end: the job goes on.
v1::Job watch(Connection& connection, const std::string& job_id, const WatchOptions& options, ProgressView& view);

}  // namespace strata::client
