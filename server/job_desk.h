// The desk where jobs are handed in: admits, queues, starts, cancels, remembers, and tells watchers. Knows no gRPC.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/blob_store.h"
#include "server/job_runner.h"
#include "server/job_store.h"
#include "server/mesher_door.h"

namespace strata::server {

struct DeskOptions {
  int queue_capacity = 1000;
  int threads_per_job = 1;
  double time_limit_seconds = 0;  // of every job; 0: none
  std::int64_t max_inline_surface_bytes = std::int64_t{1} << 20;
  std::string generator;          // version written into jobs
};

// Wants to know when there may be news of a job. poke() comes from any thread, without any lock of the desk, and must be quick.
class Watcher {
 public:
  virtual ~Watcher() = default;
  virtual void poke() = 0;
};

struct News {
  std::vector<v1::WatchJobResponse> events;  // in order
  std::optional<v1::Job> done;               // the job is final and `events` were its last
};

class JobDesk {
 public:
  JobDesk(JobStore& jobs, BlobStore& blobs, JobRunner& runner, MesherDoor mesher, DeskOptions options);
  ~JobDesk();

  struct Created {
    v1::Job job;
    bool existing = false;
  };
  // Durable on return. Throws Refusal or MeshError(InvalidInput).
  Created create(v1::CreateJobRequest request);
  v1::Job get(const std::string& job_id) const;
  JobPage list(const v1::ListJobsRequest& request) const;
  v1::Job cancel(const std::string& job_id);
  void remove(const v1::DeleteJobRequest& request);

  // Pokes `watcher` now and then, and whenever something happens to the job, for as long as it lives.
  void watch(const std::string& job_id, const std::weak_ptr<Watcher>& watcher);
  // What happened after that sequence. Throws Refusal NOT_FOUND.
  News news(const std::string& job_id, std::int64_t after_sequence, bool with_progress) const;

  // The typed specification and a readable surface reference, or Refusal / MeshError(InvalidInput). Shared with ValidateJob.
  template <class Request>
  v1::MeshSpec checked_spec(const Request& request) const;
  void check_surface(const v1::Surface& surface) const;

  // No new jobs from now on.
  void drain();
  [[nodiscard]] bool draining() const { return draining_; }
  // Waits until nothing runs; false when the time was not enough.
  bool wait_idle(std::chrono::steady_clock::duration at_most);

  struct Load {
    int running = 0;
    int queued = 0;
    std::int64_t total = 0;
  };
  [[nodiscard]] Load load() const;
  [[nodiscard]] const DeskOptions& options() const { return options_; }
  [[nodiscard]] int slots() const { return runner_.slots(); }

 private:
  using Clock = std::chrono::steady_clock;

  // A job that is not final yet.
  struct Live {
    StoredJob stored;
    std::vector<v1::WatchJobResponse> log;
    std::optional<v1::WatchJobResponse> progress;  // the newest only
    std::vector<std::weak_ptr<Watcher>> watchers;
    Clock::time_point created, started;
    bool out_of_time = false;
    bool remove_when_done = false;
    bool unsaved = false;  // final, but the store did not take it yet: the tick tries again
  };
  using Lock = std::unique_lock<std::mutex>;

  void resume_stored_jobs();
  void check_request(v1::CreateJobRequest& request) const;
  [[nodiscard]] std::optional<Created> known_request(const std::string& request_id, const std::string& fingerprint) const;
  void store_inline_surface(v1::CreateJobRequest& request);
  void schedule(const Lock&);
  void start(const Lock&, Live& live);
  void happened(const std::string& job_id, v1::WatchJobResponse event);
  static void note(Live& live, const v1::WatchJobResponse& event);
  void finished(const std::string& job_id, v1::Job result);
  void finish(const Lock&, Live& live, v1::Job result);
  v1::WatchJobResponse& log(const Lock&, Live& live, v1::WatchJobResponse event);
  [[nodiscard]] bool save(const v1::Job& job, const std::vector<v1::WatchJobResponse>& events);
  void close(const Lock&, Live& live);
  void poke(std::vector<std::weak_ptr<Watcher>> watchers) const;
  void release_blobs(const Lock&, const StoredJob& stored);
  void count_blobs(const StoredJob& stored, int change);
  void forget(const Lock&, const std::string& job_id);
  void tick();
  [[nodiscard]] v1::Job shown(const Lock&, const Live& live) const;

  JobStore& jobs_;
  BlobStore& blobs_;
  JobRunner& runner_;
  const MesherDoor mesher_;
  const DeskOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable idle_;
  std::map<std::string, std::unique_ptr<Live>> live_;
  std::deque<std::string> queue_;
  int running_ = 0;
  std::map<std::string, int> blob_uses_;
  std::atomic<bool> draining_ = false;
  bool closing_ = false;  // what is cancelled from now on was not cancelled by its owner
  std::vector<std::weak_ptr<Watcher>> watchers_;  // all, for the tick
  std::jthread ticker_;
};

}  // namespace strata::server
