// What a run would find and what it would cost, before it is queued. ValidateJob, `strata check` and the admission of jobs ask here.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "server/blob_store.h"
#include "server/memory_ledger.h"
#include "server/mesher_door.h"
#include "strata/v1/job.pb.h"

namespace strata::server {

enum class CheckDepth {
  Cost,  // up to the octree: what the run itself would reserve
  All,   // all findings, and hexes counted one by one
};

struct CheckOrder {
  v1::Surface surface;  // with its data, or by the id of a blob that exists
  v1::MeshSpec spec;    // typed
  int threads = 1;
  CheckDepth depth = CheckDepth::All;
};

struct Checked {
  v1::ValidateJobResponse report;     // without effective_spec
  std::optional<v1::JobError> error;  // instead; code 8 (RESOURCE_EXHAUSTED): no worker could ever run this job
};

// Safe to call from any thread; does not throw. Ends early, with code 1, when `cancelled` rises.
class Checker {
 public:
  virtual ~Checker() = default;
  virtual Checked check(const CheckOrder& order, const std::atomic<bool>& cancelled) = 0;
};

// On the calling thread.
std::unique_ptr<Checker> make_thread_checker(const BlobStore& blobs, MesherDoor mesher, std::int64_t memory_budget_bytes);
// In a process of its own for each check, `program --worker PID`: what a surface does to it, it does to nothing else.
std::unique_ptr<Checker> make_process_checker(std::string program, const BlobStore& blobs, const MemoryLedger& memory);

}  // namespace strata::server
