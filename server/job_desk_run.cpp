// The life of a job at the desk, from its start to its end.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/job_desk.h"
#include "server/job_error.h"
#include "server/refusal.h"
#include "server/timestamps.h"

namespace strata::server {
namespace {

constexpr double kLongestTtl = 100.0 * 365 * 86400;  // seconds; what is asked for may be any number
constexpr double kLearning = 0.2;                    // share of the newest job in what is typical

}  // namespace

void JobDesk::schedule(const Lock& lock) {
  const auto may_run = [this](const std::string& tenant) {
    const int most = options_.limits_of(tenant).running;
    const auto found = running_of_.find(tenant);
    return most == 0 || found == running_of_.end() || found->second < most;
  };
  while (running_ < runner_.slots() && !draining_) {
    const auto id = queue_.pop(may_run);
    if (!id) return;
    start(lock, *live_.at(*id));
  }
}

void JobDesk::start(const Lock& lock, Live& live) {
  v1::Job& job = live.stored.job;
  const v1::CreateJobRequest& request = live.stored.request;
  const int threads = request.max_threads() > 0 ? std::min(request.max_threads(), options_.threads_per_job) : options_.threads_per_job;
  ++running_;
  ++running_of_[job.tenant()];
  live.running = true;
  live.charged = job.has_estimate() ? job.estimate().cpu_seconds() : typical_cost_[job.tenant()];
  queue_.charge(job.tenant(), live.charged, options_.limits_of(job.tenant()).weight);
  job.set_state(v1::JOB_STATE_RUNNING);
  job.set_threads(threads);
  job.set_attempt(job.attempt() + 1);
  *job.mutable_start_time() = timestamp_now();
  live.started = Clock::now();
  job.mutable_usage()->set_queue_seconds(std::chrono::duration<double>(live.started - live.created).count());
  v1::WatchJobResponse running;
  running.mutable_state_changed()->set_state(v1::JOB_STATE_RUNNING);
  running.mutable_state_changed()->set_attempt(job.attempt());
  log(lock, live, std::move(running));
  // Where a job can end the server, that it was started must be known afterwards. Elsewhere the tick saves it.
  if (options_.max_starts > 0 && save(job, {live.log.back()})) live.saved_events = live.log.size();
  const std::string id = job.job_id();
  runner_.start(
      {id, request, threads, owner_key(job.tenant()), job.traceparent(), job.usage().queue_seconds()},
      [this, id](v1::WatchJobResponse e) { happened(id, std::move(e)); }, [this, id](const v1::Job& result) { finished(id, result); });
}

v1::WatchJobResponse& JobDesk::log(const Lock&, Live& live, v1::WatchJobResponse event) {
  v1::Job& job = live.stored.job;
  job.set_last_sequence(job.last_sequence() + 1);
  event.set_sequence(job.last_sequence());
  *event.mutable_time() = timestamp_now();
  if (event.has_progress()) {
    *job.mutable_progress() = event.progress();
    return live.progress.emplace(std::move(event));
  }
  return live.log.emplace_back(std::move(event));
}

void JobDesk::happened(const std::string& job_id, v1::WatchJobResponse event) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  std::optional<v1::Estimate> cost;
  v1::CreateJobRequest request;
  {
    const Lock lock(mutex_);
    const auto found = live_.find(job_id);
    if (found == live_.end()) return;
    Live& live = *found->second;
    if (event.has_estimate()) {
      cost = event.estimate();
      request = live.stored.request;
    }
    note(live, event);
    log(lock, live, std::move(event));
    watchers = live.watchers;
  }
  if (cost) admission_.learn(request, *cost);
  poke(std::move(watchers));
}

// What an event says about the job besides itself.
void JobDesk::note(Live& live, v1::WatchJobResponse& event) {
  v1::Job& job = live.stored.job;
  if (event.has_estimate()) *job.mutable_estimate() = event.estimate();
  if (!event.has_state_changed()) return;
  job.set_attempt(job.attempt() + 1);  // the runner counts its own tries only
  event.mutable_state_changed()->set_attempt(job.attempt());
  job.clear_progress();
  live.progress.reset();
}

void JobDesk::finished(const std::string& job_id, const v1::Job& result) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    Lock lock(mutex_);
    const auto found = live_.find(job_id);
    if (found != live_.end()) {
      Live& live = *found->second;
      settle_accounts(lock, live, result);
      watchers = live.watchers;
      const bool interrupted = closing_ && result.state() == v1::JOB_STATE_CANCELLED && !live.stored.job.cancel_requested();
      if (!interrupted) finish(lock, live, result);  // an interrupted job runs again after the restart
    }
    --running_;
    schedule(lock);
    idle_.notify_all();
  }
  poke(std::move(watchers));
}

// What the run took, against what was charged when it began.
void JobDesk::settle_accounts(const Lock&, Live& live, const v1::Job& result) {
  const std::string& tenant = live.stored.job.tenant();
  live.running = false;
  if (--running_of_[tenant] == 0) running_of_.erase(tenant);
  const double cost = std::max(0.0, result.usage().cpu_seconds());
  queue_.charge(tenant, cost - live.charged, options_.limits_of(tenant).weight);
  double& typical = typical_cost_[tenant];
  typical += kLearning * (cost - typical);
  typical_wall_ += kLearning * (result.usage().wall_seconds() - typical_wall_);
}

// The job with its end.
v1::Job JobDesk::ended(const Live& live, const v1::Job& result) const {
  v1::Job job = live.stored.job;
  const double queued = job.usage().queue_seconds();
  job.MergeFrom(result);
  job.mutable_usage()->set_queue_seconds(queued);
  job.set_cancel_requested(false);
  *job.mutable_end_time() = timestamp_now();
  const double asked = live.stored.request.result_ttl_seconds(), most = options_.result_ttl_seconds;
  const double ttl = std::min(asked > 0 && (most == 0 || asked < most) ? asked : most, kLongestTtl);
  if (ttl > 0 && !live.remove_when_done) job.mutable_expire_time()->set_seconds(wall_seconds() + static_cast<std::int64_t>(std::ceil(ttl)));
  if (job.state() == v1::JOB_STATE_SUCCEEDED && job.has_progress()) {
    job.mutable_progress()->set_fraction(1);
    job.mutable_progress()->set_stage_fraction(1);
    job.mutable_progress()->set_eta_seconds(0);
  }
  return job;
}

// The one place where a job becomes final: first in the store, then for everybody to see. Lets go of the lock meanwhile.
v1::Job JobDesk::finish(Lock& lock, Live& live, const v1::Job& result) {
  live.ending = true;
  saved_.wait(lock, [&] { return !live.saving; });
  v1::Job job = ended(live, result);
  job.set_last_sequence(live.stored.job.last_sequence() + 1);
  v1::WatchJobResponse last;
  last.set_sequence(job.last_sequence());
  *last.mutable_time() = job.end_time();
  last.mutable_state_changed()->set_state(job.state());
  std::vector<v1::WatchJobResponse> events(live.log.begin() + static_cast<std::ptrdiff_t>(live.saved_events), live.log.end());
  events.push_back(last);
  lock.unlock();
  const bool all_saved = save(job, events);
  lock.lock();
  live.stored.job = job;
  live.log.push_back(std::move(last));
  live.unsaved = !all_saved;
  live.ending = false;
  if (all_saved) close(lock, live);
  saved_.notify_all();
  return job;
}

// Leaves a final job to the store alone.
void JobDesk::close(const Lock&, Live& live) {
  const std::string id = live.stored.job.job_id();
  if (live.remove_when_done) to_forget_.push_back(id);
  live_.erase(id);
}

// A store that fails for a while must not end a run: false, and the job goes on from memory.
bool JobDesk::save(const v1::Job& job, const std::vector<v1::WatchJobResponse>& events) {
  try {
    jobs_.update(job, events);
    return true;
  } catch (const Refusal& refusal) {
    spdlog::error(R"("msg":"job not saved","job":"{}","reason":"{}")", job.job_id(), refusal.reason);
    return false;
  }
}

}  // namespace strata::server
