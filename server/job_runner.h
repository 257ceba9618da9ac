// Where jobs run: a bounded number at once.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/mesh_job.h"

namespace strata::server {

class JobRunner {
 public:
  using Done = std::function<void(v1::Job result)>;

  virtual ~JobRunner() = default;
  [[nodiscard]] virtual int slots() const = 0;
  // Starts a job and returns at once; at most slots() may be under way. Events and the result come from another thread.
  virtual void start(JobOrder order, EventSink on_event, Done on_done) = 0;
  // Asks a running job to stop; its result comes through on_done as ever.
  virtual void cancel(const std::string& job_id) = 0;
};

// Threads of this process, each job in its own arena. The destructor cancels what runs and waits.
std::unique_ptr<JobRunner> make_thread_runner(int slots, BlobStore& blobs, MesherDoor mesher);

}  // namespace strata::server
