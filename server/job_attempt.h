// One try at a job in a worker process.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "server/blob_store.h"
#include "server/job_runner.h"
#include "server/memory_ledger.h"

namespace strata::server {

// 0: go on; else 1 + Stop.
using StopFlag = std::atomic<int>;

struct Tried {
  v1::Job job;
  bool again = false;       // another try may do better
  bool all_memory = false;  // when it may use all there is
};

// Starts a worker of `program`, follows it to its end and takes over its results. `memory_limit` holds until the job has its estimate. Throws
// Refusal or std::system_error when no worker could be started.
Tried attempt_job(const std::string& program, const JobOrder& order, int number, std::int64_t memory_limit, BlobStore& blobs,
                  MemoryLedger& memory, const EventSink& on_event, const StopFlag& stop);

}  // namespace strata::server
