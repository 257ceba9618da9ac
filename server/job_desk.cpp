#include "server/job_desk.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/ids.h"
#include "server/job_error.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

constexpr std::chrono::milliseconds kTick{100};
constexpr int kDefaultPage = 100;
constexpr int kMaxPage = 1000;
constexpr std::size_t kMaxStates = v1::JobState_ARRAYSIZE;
constexpr double kRetryWatch = 5;  // seconds
constexpr std::int64_t kLongAgo = 1;  // seconds since 1970: expired, whatever the clock says

Refusal no_job(const std::string& job_id) {
  return Refusal(Refused::NotFound, "JOB_NOT_FOUND", is_id(job_id) ? "there is no job " + job_id : "there is no such job").at("job_id");
}

v1::Job cancelled_before_it_ran() { return ended_badly(job_error(1, "CANCELLED", "the job was cancelled before it ran")); }

}  // namespace

JobDesk::JobDesk(JobStore& jobs, BlobStore& blobs, JobRunner& runner, Checker& checker, MesherDoor mesher, DeskOptions options)
    : jobs_(jobs),
      blobs_(blobs),
      runner_(runner),
      options_(std::move(options)),
      admission_(blobs, checker, std::move(mesher), options_.admission) {
  resume_stored_jobs();
  ticker_ = std::jthread([this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      tick();
      std::mutex nobody;  // a sleep that ends when it is no longer needed
      std::unique_lock lock(nobody);
      std::condition_variable_any().wait_for(lock, stop, kTick, [] { return false; });
    }
  });
}

JobDesk::~JobDesk() {
  drain();
  ticker_.request_stop();
  ticker_.join();
  {
    Lock lock(mutex_);
    closing_ = true;
    for (auto& [id, live] : live_) runner_.cancel(id, Stop::Cancelled);
    idle_.wait(lock, [this] { return running_ == 0; });
  }
  forget_ended();
}

// ---- questions and orders

v1::Job JobDesk::shown(const Lock&, const Live& live) const {
  v1::Job job = live.stored.job;
  job.set_queue_position(queue_.ahead_of(job.job_id()));
  return job;
}

JobDesk::Live* JobDesk::find_live(const Lock&, const Caller& caller, const std::string& job_id) const {
  const auto found = live_.find(job_id);
  if (found == live_.end()) return nullptr;
  if (!caller.sees(found->second->stored.job.tenant())) throw no_job(job_id);
  return found->second.get();
}

v1::Job JobDesk::get(const Caller& caller, const std::string& job_id) const {
  if (!is_id(job_id)) throw no_job(job_id);
  {
    const Lock lock(mutex_);
    if (const Live* live = find_live(lock, caller, job_id)) return shown(lock, *live);
  }
  const auto stored = jobs_.find(job_id);
  if (!stored || !caller.sees(stored->job.tenant())) throw no_job(job_id);
  return stored->job;
}

JobPage JobDesk::list(const Caller& caller, const v1::ListJobsRequest& request) const {
  if (request.page_size() < 0 || request.page_size() > kMaxPage) throw invalid_field("page_size", "must be 0 to 1000");
  const std::string& token = request.page_token();
  if (token.size() > 18 || token.find_first_not_of("0123456789") != std::string::npos)
    throw invalid_field("page_token", "is not one of this server's");
  JobQuery query;
  if (caller.role != Role::Admin) query.tenant = caller.tenant;
  query.page_size = request.page_size() == 0 ? kDefaultPage : request.page_size();
  query.token = token;
  const std::set<int> states(request.states().begin(), request.states().end());
  if (states.size() > kMaxStates) throw invalid_field("states", "are more than there are");
  if (request.labels_size() > kMaxLabels) throw invalid_field("labels", "are more than a job can have");
  query.states.assign(states.begin(), states.end());
  query.labels.assign(request.labels().begin(), request.labels().end());
  JobPage page = jobs_.list(query);
  const Lock lock(mutex_);
  for (v1::Job& job : page.jobs)
    if (const auto found = live_.find(job.job_id()); found != live_.end()) job = without_details(found->second->stored.job);
  return page;
}

// Once answered it holds, whatever ends the server meanwhile.
v1::Job JobDesk::cancel(const Caller& caller, const std::string& job_id) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  std::optional<v1::Job> unrun;
  {
    Lock lock(mutex_);
    if (Live* live = find_live(lock, caller, job_id); live != nullptr && !live->ending && !live->unsaved) {
      watchers = live->watchers;
      if (queue_.remove(job_id)) {
        unrun = finish(lock, *live, cancelled_before_it_ran());
      } else {
        live->stored.job.set_cancel_requested(true);
        runner_.cancel(job_id, Stop::Cancelled);
        save_live(lock, job_id);
      }
    }
  }
  if (unrun) options_.on_unrun(*unrun);
  poke(std::move(watchers));
  return get(caller, job_id);
}

void JobDesk::remove(const Caller& caller, const v1::DeleteJobRequest& request) {
  const std::string& id = request.job_id();
  const auto stored = is_id(id) ? jobs_.find(id) : std::nullopt;
  if (!stored || !caller.sees(stored->job.tenant())) {
    if (request.allow_missing()) return;
    throw no_job(id);
  }
  bool is_live = false;
  {
    Lock lock(mutex_);
    saved_.wait(lock, [&] {
      const auto found = live_.find(id);
      return found == live_.end() || !found->second->ending;
    });
    if (Live* live = find_live(lock, caller, id)) {
      is_live = true;
      if (!request.cancel_if_running())
        throw Refusal(Refused::FailedPrecondition, "JOB_NOT_FINISHED", "job " + id + " has not ended: cancel it first").at("job_id");
      live->remove_when_done = true;
      live->stored.job.mutable_expire_time()->set_seconds(kLongAgo);  // after a restart it goes by this
    }
  }
  if (!is_live) return forget(id);
  try {
    cancel(caller, id);
  } catch (const Refusal& refusal) {
    if (refusal.kind != Refused::NotFound) throw;  // gone already: that was the order
  }
  forget_ended();
}

// Those that were removed while they ran. One that cannot be forgotten now has expired: the sweep finds it.
void JobDesk::forget_ended() {
  std::vector<std::string> ids;
  {
    const Lock lock(mutex_);
    ids.swap(to_forget_);
  }
  for (const std::string& id : ids) forget_or_log(id);
}

void JobDesk::forget_or_log(const std::string& job_id) {
  try {
    forget(job_id);
    spdlog::info(R"("msg":"job forgotten","job":"{}")", job_id);
  } catch (const Refusal& refusal) {
    spdlog::error(R"("msg":"cannot forget a job now","job":"{}","reason":"{}")", job_id, refusal.reason);
  }
}

// The record first, then what it points to: a crash in between leaves blobs that nobody uses, which the sweep finds.
void JobDesk::forget(const std::string& job_id) {
  const auto stored = jobs_.find(job_id);
  if (!stored) return;
  jobs_.remove(job_id);
  for (const v1::Artifact& artifact : stored->job.artifacts()) blobs_.remove(artifact.blob().blob_id());
  const std::string& surface = stored->request.surface().blob_id();
  remove_unused_blob(surface);
}

// ---- watching

void JobDesk::watch(const std::string& job_id, const std::weak_ptr<Watcher>& watcher) {
  const Lock lock(mutex_);
  if (static_cast<int>(watchers_.size()) >= options_.max_watchers)
    throw Refusal(Refused::ResourceExhausted, "TOO_MANY_WATCHES", std::to_string(watchers_.size()) + " watches are open already")
        .retry_after(kRetryWatch);
  watchers_.push_back(watcher);
  const auto found = live_.find(job_id);
  if (found != live_.end()) found->second->watchers.push_back(watcher);
}

News JobDesk::news(const std::string& job_id, std::int64_t after_sequence, bool with_progress) const {
  {
    const Lock lock(mutex_);
    const auto found = live_.find(job_id);
    if (found != live_.end()) {
      const Live& live = *found->second;
      News news;
      if (live.unsaved) news.done = live.stored.job;
      const auto newer = std::upper_bound(live.log.begin(), live.log.end(), after_sequence,
                                          [](std::int64_t sequence, const v1::WatchJobResponse& e) { return sequence < e.sequence(); });
      news.events.assign(newer, live.log.end());
      if (with_progress && live.progress && live.progress->sequence() > after_sequence) {
        const auto place =
            std::find_if(news.events.begin(), news.events.end(), [&](const auto& e) { return e.sequence() > live.progress->sequence(); });
        news.events.insert(place, *live.progress);
      }
      return news;
    }
  }
  auto stored = is_id(job_id) ? jobs_.find(job_id) : std::nullopt;
  if (!stored) throw no_job(job_id);
  return {jobs_.events(job_id, after_sequence), std::move(stored->job)};
}

void JobDesk::poke(std::vector<std::weak_ptr<Watcher>> watchers) const {
  for (const std::weak_ptr<Watcher>& weak : watchers)
    if (const auto watcher = weak.lock()) watcher->poke();
}

// ---- going down

void JobDesk::drain() { draining_ = true; }

bool JobDesk::wait_idle(std::chrono::steady_clock::duration at_most) {
  Lock lock(mutex_);
  return idle_.wait_for(lock, at_most, [this] { return running_ == 0; });
}

JobDesk::Load JobDesk::load() const {
  const std::int64_t total = jobs_.count();
  const Lock lock(mutex_);
  Load load{running_, static_cast<int>(queue_.size()), total, 0, blobs_.free_bytes(), static_cast<std::int64_t>(watchers_.size())};
  for (const auto& [id, live] : live_)
    if (!live->running && queue_.holds(id))
      load.oldest_queued_seconds =
          std::max(load.oldest_queued_seconds, std::chrono::duration<double>(Clock::now() - live->created).count());
  return load;
}

}  // namespace strata::server
