// What the desk does by itself: saves what happened, stops late jobs, forgets what nobody wants any more.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <utility>

#include "server/job_desk.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

constexpr std::chrono::seconds kSaveEvery{1};        // what a crash may lose of the events of running jobs
constexpr std::chrono::seconds kSweepEvery{5};
constexpr std::size_t kTurns = 5;                    // ticks until every watcher was poked
constexpr std::chrono::minutes kSweepBlobsEvery{10};
constexpr int kForgottenAtOnce = 100;
constexpr std::int64_t kJumpSeconds = 600;           // of the clock against the time that passed: then nothing is forgotten for a while
constexpr std::chrono::minutes kAfterJump{10};
constexpr std::chrono::hours kUploadsKept{24};       // without a frame

}  // namespace

void JobDesk::tick() {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    Lock lock(mutex_);
    const Clock::time_point at = Clock::now();
    if (at - saved_at_ >= kSaveEvery) {
      saved_at_ = at;
      save_progress(lock);
    }
    stop_late_jobs(lock);
    watchers = watchers_to_poke(lock);
  }
  poke(std::move(watchers));
  forget_ended();
  if (Clock::now() - swept_ >= kSweepEvery) {
    swept_ = Clock::now();
    sweep();
  }
}

// Watchers of running jobs each time, for progress that they were not ready for; the others now and then, for heartbeats.
std::vector<std::weak_ptr<Watcher>> JobDesk::watchers_to_poke(const Lock&) {
  std::erase_if(watchers_, [](const std::weak_ptr<Watcher>& w) { return w.expired(); });
  std::vector<std::weak_ptr<Watcher>> watchers;
  for (std::size_t i = ticks_++ % kTurns; i < watchers_.size(); i += kTurns) watchers.push_back(watchers_[i]);
  for (const auto& [id, live] : live_)
    if (live->running) watchers.insert(watchers.end(), live->watchers.begin(), live->watchers.end());
  return watchers;
}

// New events of running jobs, and final jobs that the store did not take before. Lets go of the lock while it writes.
void JobDesk::save_progress(Lock& lock) {
  std::vector<std::string> ids;
  for (const auto& [id, live] : live_)
    if (!live->ending && (live->unsaved || live->saved_events < live->log.size())) ids.push_back(id);
  for (const std::string& id : ids) save_live(lock, id);
}

// What the store does not know yet of a job. Lets go of the lock while it writes; the job may be gone afterwards.
void JobDesk::save_live(Lock& lock, const std::string& job_id) {
  auto found = live_.end();
  const auto free_to_write = [&] {
    found = live_.find(job_id);
    return found == live_.end() || !found->second->saving;
  };
  saved_.wait(lock, free_to_write);
  if (found == live_.end() || found->second->ending) return;
  Live& live = *found->second;
  live.saving = true;
  const v1::Job job = live.stored.job;
  const std::size_t upto = live.log.size();
  const std::vector<v1::WatchJobResponse> events(live.log.begin() + static_cast<std::ptrdiff_t>(live.saved_events), live.log.end());
  lock.unlock();
  const bool all_saved = save(job, events);
  lock.lock();
  live.saving = false;
  saved_.notify_all();
  if (!all_saved) return;
  live.saved_events = upto;
  if (std::exchange(live.unsaved, false)) close(lock, live);
}

void JobDesk::stop_late_jobs(const Lock&) {
  const Clock::time_point at = Clock::now();
  for (auto& [id, live] : live_) {
    if (!live->running || live->out_of_time) continue;
    double limit = live->stored.request.time_limit_seconds();
    if (options_.time_limit_seconds > 0 && (limit == 0 || options_.time_limit_seconds < limit)) limit = options_.time_limit_seconds;
    if (limit == 0 || std::chrono::duration<double>(at - live->started).count() < limit) continue;
    live->out_of_time = true;
    runner_.cancel(id, Stop::OutOfTime);
  }
}

std::int64_t JobDesk::wall_seconds() const {
  if (options_.wall_clock) return options_.wall_clock();
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// Did the clock move by itself? Somebody set it, or the machine slept: no reason to throw results away.
bool JobDesk::clock_jumped(std::int64_t now) {
  const Clock::time_point at = Clock::now();
  const bool first = !wall_at_;
  const auto passed = std::chrono::duration_cast<std::chrono::seconds>(at - steady_at_).count();
  const bool jumped = !first && std::llabs((now - *wall_at_) - passed) > kJumpSeconds;
  wall_at_ = now;
  steady_at_ = at;
  return jumped;
}

void JobDesk::sweep() {
  const std::int64_t now = wall_seconds();
  if (clock_jumped(now)) {
    spdlog::warn(R"("msg":"the clock jumped: nothing is forgotten for a while")");
    swept_ = swept_blobs_ = Clock::now() + kAfterJump;
    return;
  }
  try {
    for (const std::string& id : jobs_.expired(now, kForgottenAtOnce)) forget_or_log(id);
    if (Clock::now() - swept_blobs_ >= kSweepBlobsEvery) {
      swept_blobs_ = Clock::now();
      sweep_blobs(now);
    }
  } catch (const Refusal& refusal) {
    spdlog::error(R"("msg":"cannot forget jobs now","reason":"{}")", refusal.reason);
  }
}

// Surfaces that no job uses any more, and results that a crash left without a job.
void JobDesk::sweep_blobs(std::int64_t now) {
  const auto time = [now](std::chrono::duration<double> ago) {
    return std::chrono::system_clock::from_time_t(now) - std::chrono::duration_cast<std::chrono::system_clock::duration>(ago);
  };
  blobs_.drop_uploads_idle_since(time(kUploadsKept));
  if (options_.surface_ttl_seconds <= 0) return;
  for (const std::string& id : blobs_.idle_since(time(std::chrono::duration<double>(options_.surface_ttl_seconds)))) remove_unused_blob(id);
}

}  // namespace strata::server
