// One job, from the stored surface to stored artifacts. Runs where a runner puts it: on a thread here, or in a worker process.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "server/blob_store.h"
#include "server/mesher_door.h"
#include "strata/v1/job.pb.h"

namespace strata {
struct Estimate;
}

namespace strata::server {

struct JobOrder {
  std::string job_id;
  v1::CreateJobRequest request;  // surface by blob_id, specification typed
  int threads = 1;
  std::string owner;  // of the results
  std::string traceparent;
  double queue_seconds = 0;
  std::int64_t memory_budget_bytes = 0;  // of all jobs together; 0: no limit. The runner knows it
};

// What happens on the way, without sequence: progress (at most 10 a second), stage_ended, estimate, quality, adjustment. Called from one
// thread.
using EventSink = std::function<void(v1::WatchJobResponse)>;

// Asked once, when the cost of the rest is known: returns when the memory is there, throws MeshError when it will not be.
using MemoryGate = std::function<void(const Estimate&)>;

// Returns the fields of Job that the run decides: state (SUCCEEDED, FAILED or CANCELLED), error or artifacts, rung, patches, quality, stages,
// adjustments, usage, counts. Does not throw. Nothing is stored unless it succeeds.
v1::Job run_mesh_job(const JobOrder& order, BlobStore& blobs, const MesherDoor& mesher, const std::atomic<bool>& cancel,
                     const MemoryGate& gate, const EventSink& sink);

}  // namespace strata::server
