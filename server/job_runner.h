// Where jobs run: a bounded number at once.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/memory_ledger.h"
#include "server/mesh_job.h"

namespace strata::server {

enum class Stop {
  Cancelled,   // somebody asked for it
  OutOfTime,   // it took too long: say where it was
};

class JobRunner {
 public:
  using Done = std::function<void(v1::Job result)>;

  virtual ~JobRunner() = default;
  [[nodiscard]] virtual int slots() const = 0;
  // Starts a job and returns at once; at most slots() may be under way. Events and the result come from another thread.
  virtual void start(JobOrder order, EventSink on_event, Done on_done) = 0;
  // Asks a running job to stop; its result comes through on_done as ever: cancelled, or failed when it is out of time. The first reason counts.
  virtual void cancel(const std::string& job_id, Stop why) = 0;
};

// Threads of this process, each job in its own arena. The destructor cancels what runs and waits.
std::unique_ptr<JobRunner> make_thread_runner(int slots, BlobStore& blobs, MemoryLedger& memory, MesherDoor mesher);

struct ProcessOptions {
  int slots = 1;
  std::string program = "/proc/self/exe";  // started as `program --worker PID`, see server/worker.h
};
// A process for each job, which dies with this one. What goes wrong in it ends it and nothing else: it is replaced once, then the job fails
// with the stage and the backtrace. A job that does not heed cancel is killed. The destructor cancels what runs and waits.
std::unique_ptr<JobRunner> make_process_runner(const ProcessOptions& options, BlobStore& blobs, MemoryLedger& memory);

}  // namespace strata::server
