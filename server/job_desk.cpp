#include "server/job_desk.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/ids.h"
#include "server/job_error.h"
#include "server/refusal.h"
#include "server/timestamps.h"

namespace strata::server {
namespace {

constexpr std::chrono::milliseconds kTick{100};
constexpr int kDefaultPage = 100;
constexpr int kMaxPage = 1000;
constexpr std::size_t kShortQueue = 16;         // jobs; see prices_now
constexpr double kRetrySeconds = 5;             // when nothing better is known
constexpr double kLongestTtl = 100.0 * 365 * 86400;  // seconds; what is asked for may be any number
constexpr double kLearning = 0.2;               // share of the newest job in what is typical
constexpr std::int64_t kSequenceGap = 1'000'000;  // numbers that a run lost by a crash may have given to events nobody saved

double steady_seconds(std::chrono::steady_clock::time_point at) { return std::chrono::duration<double>(at.time_since_epoch()).count(); }

Refusal no_job(const std::string& job_id) {
  return Refusal(Refused::NotFound, "JOB_NOT_FOUND", is_id(job_id) ? "there is no job " + job_id : "there is no such job").at("job_id");
}

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
      std::this_thread::sleep_for(kTick);
      tick();
    }
  });
}

JobDesk::~JobDesk() {
  drain();
  ticker_.request_stop();
  ticker_.join();
  Lock lock(mutex_);
  closing_ = true;
  for (auto& [id, live] : live_) runner_.cancel(id, Stop::Cancelled);
  idle_.wait(lock, [this] { return running_ == 0; });
}

// ---- admission

// The order in which load is shed: going down, queue full, tenant's share full, disk full. Reading and cancelling are never refused.
void JobDesk::check_room(const Lock&, const std::string& tenant) const {
  const auto full = [this](const char* reason, const std::string& message) {
    return Refusal(Refused::ResourceExhausted, reason, message).retry_after(seconds_until_room());
  };
  const auto waiting = static_cast<int>(queue_.size());
  if (waiting + arriving_ >= options_.queue_capacity) throw full("QUEUE_FULL", std::to_string(waiting) + " jobs are waiting already");
  const TenantLimits limits = options_.limits_of(tenant);
  if (limits.queued > 0 && static_cast<int>(queue_.size_of(tenant)) >= limits.queued)
    throw full("TENANT_QUOTA", "this tenant may have " + std::to_string(limits.queued) + " jobs waiting");
}

void JobDesk::check_storage(const std::string& tenant) const {
  const auto full = [this](const char* reason, const std::string& message) {
    const Lock lock(mutex_);
    return Refusal(Refused::ResourceExhausted, reason, message).retry_after(seconds_until_room());
  };
  const TenantLimits limits = options_.limits_of(tenant);
  if (limits.bytes > 0 && jobs_.usage(tenant).bytes >= limits.bytes)
    throw full("TENANT_QUOTA", "the results of this tenant take the " + std::to_string(limits.bytes) + " bytes it may have: delete some");
  if (options_.disk_reserve_bytes > 0 && blobs_.free_bytes() < options_.disk_reserve_bytes)
    throw full("STORAGE_FULL", "the server is short of disk space");
}

// Guessed from the jobs of late, and spread a little, so that not everybody comes back at once.
double JobDesk::seconds_until_room() const {
  const double a_slot = typical_wall_ / std::max(1, runner_.slots());
  const double spread = 0.2 * static_cast<double>(std::hash<std::int64_t>{}(Clock::now().time_since_epoch().count()) % 1000) / 1000;
  return std::clamp(a_slot, 1.0, 60.0) * (1 + spread);
}

std::optional<JobDesk::Created> JobDesk::known_request(const std::string& tenant, const std::string& request_id,
                                                       const std::string& fingerprint) const {
  if (request_id.empty()) return {};
  const auto known = jobs_.find_request(tenant, request_id);
  if (!known) return {};
  if (known->fingerprint == fingerprint) return Created{known->job, true};
  throw Refusal(Refused::AlreadyExists, "REQUEST_ID_REUSED", "request_id was used for another request, job " + known->job.job_id())
      .at("request_id");
}

void JobDesk::store_inline_surface(const std::string& tenant, v1::CreateJobRequest& request) {
  if (!request.surface().has_data()) return;
  const auto writer = blobs_.create(owner_key(tenant));
  writer->write(request.surface().data());
  request.mutable_surface()->set_blob_id(writer->publish().id);
}

// Behind a long queue there is time enough to price a job when its turn comes; looking at each that comes would only keep the cores from the
// jobs that run.
bool JobDesk::prices_now() const {
  const Lock lock(mutex_);
  const bool must_wait = running_ + arriving_ >= runner_.slots() || queue_.size() > 0;
  return must_wait && queue_.size() < kShortQueue;
}

JobDesk::Created JobDesk::create(const Caller& caller, v1::CreateJobRequest request, Estimating estimating) {
  const std::string fingerprint = fingerprint_of(request);
  if (auto known = known_request(caller.tenant, request.request_id(), fingerprint)) return *known;
  if (draining_) throw Refusal(Refused::Unavailable, "DRAINING", "the server is shutting down").retry_after(kRetrySeconds);
  admission_.check(caller, request);
  {
    const Lock lock(mutex_);
    check_room(lock, caller.tenant);
    ++arriving_;
  }
  const auto arrived = [this] {
    const Lock lock(mutex_);
    --arriving_;
  };
  try {
    check_storage(caller.tenant);
    const auto cost = admission_.cost(request, prices_now() ? estimating : Estimating::Known);
    store_inline_surface(caller.tenant, request);
    Created created = store(std::move(request), cost, caller, fingerprint);
    arrived();
    return created;
  } catch (...) {
    arrived();
    throw;
  }
}

// Durable first, then in the queue.
JobDesk::Created JobDesk::store(v1::CreateJobRequest request, const std::optional<v1::Estimate>& cost, const Caller& caller,
                                const std::string& fingerprint) {
  const std::string& tenant = caller.tenant;
  auto live = std::make_unique<Live>();
  v1::Job& job = live->stored.job;
  job.set_job_id(random_id());
  job.set_tenant(tenant);
  job.set_traceparent(caller.traceparent);
  job.set_state(v1::JOB_STATE_QUEUED);
  job.set_display_name(request.display_name());
  *job.mutable_labels() = request.labels();
  job.set_priority(request.priority());
  *job.mutable_create_time() = timestamp_now();
  *job.mutable_spec() = request.spec();
  job.set_generator(options_.generator);
  if (cost) *job.mutable_estimate() = *cost;
  const std::string surface = request.surface().blob_id();
  live->stored.request = std::move(request);
  live->stored.fingerprint = fingerprint;
  live->created = Clock::now();
  v1::WatchJobResponse queued;
  queued.mutable_state_changed()->set_state(v1::JOB_STATE_QUEUED);
  blobs_.touch(surface);
  if (!jobs_.insert(live->stored, log(Lock(), *live, std::move(queued)))) {
    // Another call with the same request id was quicker.
    if (auto known = known_request(tenant, live->stored.request.request_id(), fingerprint)) return *known;
    throw Refusal(Refused::Unavailable, "STORAGE_FAILED", "the job could not be stored").retry_after(kRetrySeconds);
  }
  live->saved_events = live->log.size();
  const std::string id = job.job_id();
  if (!blobs_.find(surface)) {
    jobs_.remove(id);
    throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "surface.blob_id: the blob was removed meanwhile").at("surface.blob_id");
  }
  const Lock lock(mutex_);
  Live& kept = *(live_[id] = std::move(live));
  queue_.push(id, tenant, job.priority(), steady_seconds(kept.created));
  schedule(lock);
  return {shown(lock, kept), false};
}

void JobDesk::resume_stored_jobs() {
  const Lock lock(mutex_);
  for (StoredJob& stored : jobs_.unfinished()) resume(lock, std::move(stored));
  schedule(lock);
}

// False when the job has been started too often: it may be what ends the server each time.
bool JobDesk::resume(const Lock& lock, StoredJob stored) {
  const std::string id = stored.job.job_id();
  auto live = std::make_unique<Live>();
  live->log = jobs_.events(id, 0);
  live->saved_events = live->log.size();
  live->stored = std::move(stored);
  live->created = Clock::now();
  v1::Job& job = live->stored.job;
  const bool deadly = options_.max_starts > 0 && job.attempt() >= options_.max_starts;
  job.set_last_sequence(job.last_sequence() + kSequenceGap);
  if (deadly) {
    job = ended(*live, ended_badly(job_error(13, "POISON_JOB",
                                             "the server ended " + std::to_string(job.attempt()) + " times while it ran this job")));
    v1::WatchJobResponse event;
    event.mutable_state_changed()->set_state(job.state());
    jobs_.update(job, {log(lock, *live, std::move(event))});
    return false;
  }
  if (job.state() == v1::JOB_STATE_RUNNING) {
    job.set_state(v1::JOB_STATE_QUEUED);
    job.clear_progress();
    v1::WatchJobResponse queued;
    queued.mutable_state_changed()->set_state(v1::JOB_STATE_QUEUED);
    log(lock, *live, std::move(queued));
  }
  queue_.push(id, job.tenant(), job.priority(), steady_seconds(live->created));
  live_[id] = std::move(live);
  return true;
}

// ---- running

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
      [this, id](v1::WatchJobResponse e) { happened(id, std::move(e)); }, [this, id](v1::Job result) { finished(id, std::move(result)); });
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

void JobDesk::finished(const std::string& job_id, v1::Job result) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    Lock lock(mutex_);
    const auto found = live_.find(job_id);
    if (found != live_.end()) {
      Live& live = *found->second;
      settle_accounts(lock, live, result);
      watchers = live.watchers;
      const bool interrupted = closing_ && result.state() == v1::JOB_STATE_CANCELLED && !live.stored.job.cancel_requested();
      if (!interrupted) finish(lock, live, std::move(result));  // an interrupted job runs again after the restart
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
v1::Job JobDesk::ended(const Live& live, v1::Job result) const {
  if (live.out_of_time && result.state() == v1::JOB_STATE_CANCELLED) {
    const v1::JobError stopped = result.error();
    result.set_state(v1::JOB_STATE_FAILED);
    *result.mutable_error() = job_error(4, "TIME_BUDGET_EXCEEDED", "the job took longer than its time limit");
    result.mutable_error()->set_stage(stopped.stage());
    result.mutable_error()->set_backtrace(stopped.backtrace());
  }
  v1::Job job = live.stored.job;
  const double queued = job.usage().queue_seconds();
  job.MergeFrom(result);
  job.mutable_usage()->set_queue_seconds(queued);
  job.set_cancel_requested(false);
  *job.mutable_end_time() = timestamp_now();
  const double asked = live.stored.request.result_ttl_seconds(), most = options_.result_ttl_seconds;
  const double ttl = std::min(asked > 0 && (most == 0 || asked < most) ? asked : most, kLongestTtl);
  if (ttl > 0) job.mutable_expire_time()->set_seconds(wall_seconds() + static_cast<std::int64_t>(std::ceil(ttl)));
  if (job.state() == v1::JOB_STATE_SUCCEEDED && job.has_progress()) {
    job.mutable_progress()->set_fraction(1);
    job.mutable_progress()->set_stage_fraction(1);
    job.mutable_progress()->set_eta_seconds(0);
  }
  return job;
}

// The one place where a job becomes final: first in the store, then for everybody to see. Lets go of the lock meanwhile.
void JobDesk::finish(Lock& lock, Live& live, v1::Job result) {
  live.ending = true;
  saved_.wait(lock, [&] { return !live.saving; });
  v1::Job job = ended(live, std::move(result));
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
  live.stored.job = std::move(job);
  live.log.push_back(std::move(last));
  live.unsaved = !all_saved;
  live.ending = false;
  if (all_saved) close(lock, live);
}

// Leaves a final job to the store alone.
void JobDesk::close(const Lock&, Live& live) {
  const std::string id = live.stored.job.job_id();
  const bool remove = live.remove_when_done;
  live_.erase(id);
  if (remove) forget(id);
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
  query.states.assign(request.states().begin(), request.states().end());
  query.labels.assign(request.labels().begin(), request.labels().end());
  JobPage page = jobs_.list(query);
  const Lock lock(mutex_);
  for (v1::Job& job : page.jobs)
    if (const auto found = live_.find(job.job_id()); found != live_.end()) job = without_details(found->second->stored.job);
  return page;
}

v1::Job JobDesk::cancel(const Caller& caller, const std::string& job_id) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    Lock lock(mutex_);
    if (Live* live = find_live(lock, caller, job_id); live != nullptr && !live->ending && !live->unsaved) {
      watchers = live->watchers;
      if (queue_.remove(job_id)) {
        finish(lock, *live, ended_badly(job_error(1, "CANCELLED", "the job was cancelled before it ran")));
      } else {
        live->stored.job.set_cancel_requested(true);
        runner_.cancel(job_id, Stop::Cancelled);
      }
    }
  }
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
    const Lock lock(mutex_);
    if (Live* live = find_live(lock, caller, id)) {
      is_live = true;
      if (!request.cancel_if_running())
        throw Refusal(Refused::FailedPrecondition, "JOB_NOT_FINISHED", "job " + id + " has not ended: cancel it first").at("job_id");
      live->remove_when_done = true;
    }
  }
  if (!is_live) return forget(id);
  try {
    cancel(caller, id);
  } catch (const Refusal&) {
    // it is gone already: that was the order
  }
}

// The record first, then what it points to: a crash in between leaves blobs that nobody uses, which the sweep finds.
void JobDesk::forget(const std::string& job_id) {
  const auto stored = jobs_.find(job_id);
  if (!stored) return;
  jobs_.remove(job_id);
  for (const v1::Artifact& artifact : stored->job.artifacts()) blobs_.remove(artifact.blob().blob_id());
  const std::string& surface = stored->request.surface().blob_id();
  if (!jobs_.uses(surface)) blobs_.remove(surface);
}

// ---- watching

void JobDesk::watch(const std::string& job_id, const std::weak_ptr<Watcher>& watcher) {
  const Lock lock(mutex_);
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
