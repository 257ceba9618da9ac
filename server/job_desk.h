// The desk where jobs are handed in: admits, queues, starts, cancels, remembers, and tells watchers. Knows no gRPC.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/admission.h"
#include "server/blob_store.h"
#include "server/caller.h"
#include "server/job_queue.h"
#include "server/job_runner.h"
#include "server/job_store.h"
#include "server/mesher_door.h"

namespace strata::server {

struct DeskOptions {
  int queue_capacity = 1000;
  int max_watchers = 20'000;  // some 15 KiB each
  int threads_per_job = 1;
  AdmissionOptions admission;
  double time_limit_seconds = 0;      // of every job; 0: none
  double result_ttl_seconds = 0;      // after the end of a job; 0: results stay until deleted
  double surface_ttl_seconds = 86400; // of blobs that no job uses; 0: they stay
  std::int64_t disk_reserve_bytes = 0;  // no new jobs when less is free
  int max_starts = 0;                 // of a job, restarts of the server included; then it counts as deadly. 0: no limit
  std::string generator;              // version written into jobs
  std::function<TenantLimits(const std::string&)> limits_of = [](const std::string&) { return TenantLimits{}; };
  std::function<std::int64_t()> wall_clock;  // seconds since 1970; empty: the system's
  std::function<void(const v1::Job&)> on_unrun = [](const v1::Job&) {};  // hears of jobs that ended without a runner
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
  JobDesk(JobStore& jobs, BlobStore& blobs, JobRunner& runner, Checker& checker, MesherDoor mesher, DeskOptions options);
  ~JobDesk();

  struct Created {
    v1::Job job;
    bool existing = false;
  };
  // Durable on return. Throws Refusal, MeshError or JobRefused.
  Created create(const Caller& caller, v1::CreateJobRequest request, PriceUnless unless = nullptr);
  // May the tenant store so many bytes more, or anything at all? Throws Refusal RESOURCE_EXHAUSTED.
  void check_storage(const std::string& tenant, std::int64_t more) const;
  // Should a job that comes now be priced first? One that can run at once prices itself.
  [[nodiscard]] bool prices_now() const;
  // Jobs of other tenants do not exist for a caller: NOT_FOUND.
  v1::Job get(const Caller& caller, const std::string& job_id) const;
  JobPage list(const Caller& caller, const v1::ListJobsRequest& request) const;
  v1::Job cancel(const Caller& caller, const std::string& job_id);
  void remove(const Caller& caller, const v1::DeleteJobRequest& request);

  // Pokes `watcher` now and then, and whenever something happens to the job, for as long as it lives. Throws Refusal RESOURCE_EXHAUSTED.
  void watch(const std::string& job_id, const std::weak_ptr<Watcher>& watcher);
  // What happened after that sequence. Throws Refusal NOT_FOUND.
  News news(const std::string& job_id, std::int64_t after_sequence, bool with_progress) const;

  [[nodiscard]] Admission& admission() { return admission_; }
  [[nodiscard]] const AdmissionOptions& admission_options() const { return options_.admission; }

  // No new jobs from now on.
  void drain();
  [[nodiscard]] bool draining() const { return draining_; }
  // Waits until nothing runs; false when the time was not enough.
  bool wait_idle(std::chrono::steady_clock::duration at_most);

  struct Load {
    int running = 0;
    int queued = 0;
    std::int64_t total = 0;
    double oldest_queued_seconds = 0;
    std::int64_t disk_free_bytes = 0;
    std::int64_t watchers = 0;
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
    std::size_t saved_events = 0;  // of the log
    std::optional<v1::WatchJobResponse> progress;  // the newest only
    std::vector<std::weak_ptr<Watcher>> watchers;
    Clock::time_point created, started;
    double charged = 0;  // core seconds the tenant was charged with in advance
    bool running = false;
    bool out_of_time = false;
    bool remove_when_done = false;
    bool saving = false;  // somebody writes it, without the lock
    bool ending = false;  // its end is decided and being written
    bool unsaved = false;  // final, but the store did not take it: the tick tries again
  };
  using Lock = std::unique_lock<std::mutex>;

  void resume_stored_jobs();
  bool resume(const Lock& lock, StoredJob stored);
  void check_room(const Lock& lock, const std::string& tenant) const;
  [[nodiscard]] double seconds_until_room() const;
  [[nodiscard]] std::optional<Created> known_request(const std::string& tenant, const std::string& request_id,
                                                     const std::string& fingerprint) const;
  class Pin;
  std::unique_ptr<Pin> pin_surface(const std::string& tenant, v1::CreateJobRequest& request);
  void remove_unused_blob(const std::string& blob_id);
  Created store(v1::CreateJobRequest request, const std::optional<v1::Estimate>& cost, const Caller& caller,
                const std::string& fingerprint);
  void schedule(const Lock& lock);
  void start(const Lock& lock, Live& live);
  void happened(const std::string& job_id, v1::WatchJobResponse event);
  static void note(Live& live, v1::WatchJobResponse& event);
  void finished(const std::string& job_id, const v1::Job& result);
  void settle_accounts(const Lock& lock, Live& live, const v1::Job& result);
  [[nodiscard]] v1::Job ended(const Live& live, const v1::Job& result) const;
  v1::Job finish(Lock& lock, Live& live, const v1::Job& result);
  v1::WatchJobResponse& log(const Lock& lock, Live& live, v1::WatchJobResponse event);
  [[nodiscard]] bool save(const v1::Job& job, const std::vector<v1::WatchJobResponse>& events);
  void close(const Lock& lock, Live& live);
  void poke(std::vector<std::weak_ptr<Watcher>> watchers) const;
  void forget(const std::string& job_id);
  [[nodiscard]] Live* find_live(const Lock& lock, const Caller& caller, const std::string& job_id) const;
  [[nodiscard]] v1::Job shown(const Lock& lock, const Live& live) const;

  void tick();
  std::vector<std::weak_ptr<Watcher>> watchers_to_poke(const Lock& lock);
  void save_progress(Lock& lock);
  void save_live(Lock& lock, const std::string& job_id);
  void forget_ended();
  void forget_or_log(const std::string& job_id);
  void stop_late_jobs(const Lock& lock);
  void sweep();
  void sweep_blobs(std::int64_t now);
  [[nodiscard]] std::int64_t wall_seconds() const;
  [[nodiscard]] bool clock_jumped(std::int64_t now);

  JobStore& jobs_;
  BlobStore& blobs_;
  JobRunner& runner_;
  const DeskOptions options_;
  Admission admission_;

  mutable std::mutex mutex_;
  std::condition_variable idle_, saved_;
  std::map<std::string, std::unique_ptr<Live>> live_;
  JobQueue queue_;
  int running_ = 0;
  int arriving_ = 0;  // being stored
  std::map<std::string, int> arriving_of_;  // tenant
  std::vector<std::string> to_forget_;  // removed while they ran, and ended since
  std::map<std::string, int> running_of_;  // tenant
  std::map<std::string, double> typical_cost_;  // tenant: core seconds of its jobs of late
  double typical_wall_ = 10;  // seconds of the jobs of late
  std::atomic<bool> draining_ = false;
  std::mutex pinning_;
  std::multiset<std::string> pinned_;  // surfaces of jobs that are being stored
  bool closing_ = false;  // what is cancelled from now on was not cancelled by its owner
  std::vector<std::weak_ptr<Watcher>> watchers_;  // all, for the tick
  std::size_t ticks_ = 0;
  Clock::time_point swept_, swept_blobs_, saved_at_, steady_at_;
  std::optional<std::int64_t> wall_at_;
  std::jthread ticker_;
};

}  // namespace strata::server
