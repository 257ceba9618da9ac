// How jobs come to the desk: from clients, and from the store after a restart.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/ids.h"
#include "server/job_desk.h"
#include "server/job_error.h"
#include "server/job_log.h"
#include "server/refusal.h"
#include "server/timestamps.h"
#include "server/trace.h"

namespace strata::server {
namespace {

constexpr std::size_t kShortQueue = 16;           // jobs; see prices_now
constexpr int kMostUploads = 10'000;              // unfinished ones of a tenant
constexpr double kRetrySeconds = 5;               // when nothing better is known
constexpr std::int64_t kSequenceGap = 1'000'000;  // numbers that a run lost by a crash may have given to events nobody saved

double steady_seconds(std::chrono::steady_clock::time_point at) { return std::chrono::duration<double>(at.time_since_epoch()).count(); }

void log_accepted(const Caller& caller, const v1::Job& job) {
  spdlog::info(R"("msg":"job accepted","job":"{}","tenant":"{}","by":"{}","request_id":"{}","trace_id":"{}")", job.job_id(), caller.tenant,
               json_escaped(caller.name), json_escaped(caller.request_id), trace_of(job.traceparent()).trace_id);
}

}  // namespace

// The order in which load is shed: going down, queue full, tenant's share full, disk full. Reading and cancelling are never refused.
void JobDesk::check_room(const Lock&, const std::string& tenant) const {
  const auto full = [this](const char* reason, const std::string& message) {
    return Refusal(Refused::ResourceExhausted, reason, message).retry_after(seconds_until_room());
  };
  const auto waiting = static_cast<int>(queue_.size());
  if (waiting + arriving_ >= options_.queue_capacity) throw full("QUEUE_FULL", std::to_string(waiting) + " jobs are waiting already");
  const TenantLimits limits = options_.limits_of(tenant);
  const auto coming = arriving_of_.find(tenant);
  const int ahead = static_cast<int>(queue_.size_of(tenant)) + (coming == arriving_of_.end() ? 0 : coming->second);
  if (limits.queued > 0 && ahead >= limits.queued)
    throw full("TENANT_QUOTA", "this tenant may have " + std::to_string(limits.queued) + " jobs waiting");
}

void JobDesk::check_storage(const std::string& tenant, std::int64_t more) const {
  const auto full = [this](const char* reason, const std::string& message) {
    const Lock lock(mutex_);
    return Refusal(Refused::ResourceExhausted, reason, message).retry_after(seconds_until_room());
  };
  const TenantLimits limits = options_.limits_of(tenant);
  const BlobUsage usage = blobs_.usage(owner_key(tenant));
  if (usage.uploads >= kMostUploads)
    throw full("TENANT_QUOTA",
               std::to_string(usage.uploads) + " uploads of this tenant are unfinished: those that nobody continues end by themselves");
  if (limits.bytes > 0 && more > limits.bytes)  // no use to ask again
    throw Refusal(Refused::ResourceExhausted, "TENANT_QUOTA",
                  std::to_string(more) + " bytes are more than the " + std::to_string(limits.bytes) + " this tenant may have in all");
  if (limits.bytes > 0 && std::max<std::int64_t>(more, 1) > limits.bytes - usage.stored - usage.announced)
    throw full("TENANT_QUOTA", "surfaces, results and unfinished uploads of this tenant take " +
                                   std::to_string(usage.stored + usage.announced) + " of the " + std::to_string(limits.bytes) +
                                   " bytes it may have: delete some jobs");
  if (options_.disk_reserve_bytes > 0 && blobs_.free_bytes() - more < options_.disk_reserve_bytes)
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

// No job uses this blob yet, but one will: it stays.
class JobDesk::Pin {
 public:
  Pin(JobDesk& desk, std::string blob_id) : desk_(desk), blob_id_(std::move(blob_id)) {
    const std::lock_guard lock(desk_.pinning_);
    desk_.pinned_.insert(blob_id_);
  }
  ~Pin() {
    const std::lock_guard lock(desk_.pinning_);
    desk_.pinned_.erase(desk_.pinned_.find(blob_id_));
  }
  Pin(const Pin&) = delete;
  Pin& operator=(const Pin&) = delete;

 private:
  JobDesk& desk_;
  const std::string blob_id_;
};

void JobDesk::remove_unused_blob(const std::string& blob_id) {
  const std::lock_guard lock(pinning_);
  if (!pinned_.contains(blob_id) && !jobs_.uses(blob_id)) blobs_.remove(blob_id);
}

// The surface of a request as a blob that stays. One that came with the request before need not be stored again.
std::unique_ptr<JobDesk::Pin> JobDesk::pin_surface(const std::string& tenant, v1::CreateJobRequest& request) {
  v1::Surface& surface = *request.mutable_surface();
  if (!surface.has_data()) return std::make_unique<Pin>(*this, surface.blob_id());
  const std::string owner = owner_key(tenant);
  if (const auto known = blobs_.find_digest(digest_of(surface.data()), owner)) {
    auto pin = std::make_unique<Pin>(*this, known->id);
    if (blobs_.find(known->id)) {  // else it was removed before it was pinned
      surface.set_blob_id(known->id);
      return pin;
    }
  }
  const auto writer = blobs_.create(owner);
  writer->write(surface.data());
  surface.set_blob_id(writer->publish().id);
  return std::make_unique<Pin>(*this, surface.blob_id());
}

// Behind a long queue there is time enough to price a job when its turn comes; looking at each that comes would only keep the cores from the
// jobs that run.
bool JobDesk::prices_now() const {
  const Lock lock(mutex_);
  const bool must_wait = running_ + arriving_ >= runner_.slots() || queue_.size() > 0;
  return must_wait && queue_.size() < kShortQueue;
}

JobDesk::Created JobDesk::create(const Caller& caller, v1::CreateJobRequest request, PriceUnless unless) {
  const std::string fingerprint = fingerprint_of(request);
  if (auto known = known_request(caller.tenant, request.request_id(), fingerprint)) return *known;
  if (draining_) throw Refusal(Refused::Unavailable, "DRAINING", "the server is shutting down").retry_after(kRetrySeconds);
  admission_.check(caller, request);
  {
    const Lock lock(mutex_);
    check_room(lock, caller.tenant);
    ++arriving_;
    ++arriving_of_[caller.tenant];
  }
  const auto arrived = [&] {
    const Lock lock(mutex_);
    --arriving_;
    if (--arriving_of_[caller.tenant] == 0) arriving_of_.erase(caller.tenant);
  };
  try {
    check_storage(caller.tenant, static_cast<std::int64_t>(request.surface().data().size()));
    const auto cost = admission_.cost(request, unless);
    const auto pin = pin_surface(caller.tenant, request);
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
  log_accepted(caller, job);
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

// False when the job has ended now: its owner had cancelled it, or it has been started too often and may be what ends the server each time.
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
  if (job.cancel_requested() || deadly) {
    live->remove_when_done = job.has_expire_time();  // nothing else expires before its end
    job = ended(*live, ended_badly(job.cancel_requested()
                                       ? job_error(1, "CANCELLED", "the run was cancelled")
                                       : job_error(13, "POISON_JOB",
                                                   "the server ended " + std::to_string(job.attempt()) + " times while it ran this job")));
    v1::WatchJobResponse event;
    event.mutable_state_changed()->set_state(job.state());
    jobs_.update(job, {log(lock, *live, std::move(event))});
    options_.on_unrun(job);
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

}  // namespace strata::server
