#include "server/job_desk.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/util/time_util.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <utility>

#include "proto/wire/sha256.h"
#include "server/convert.h"
#include "server/ids.h"
#include "server/refusal.h"
#include "server/spec_json.h"

namespace strata::server {
namespace {

constexpr std::chrono::milliseconds kTick{100};
constexpr std::size_t kMaxRequestId = 128;
constexpr std::size_t kMaxDisplayName = 256;
constexpr int kMaxLabels = 32;
constexpr std::size_t kMaxLabel = 128;
constexpr int kDefaultPage = 100;
constexpr int kMaxPage = 1000;
constexpr double kRetrySeconds = 5;  // until a slot is likely free, when nothing better is known

google::protobuf::Timestamp now() { return google::protobuf::util::TimeUtil::GetCurrentTime(); }

Refusal invalid(const std::string& field, const std::string& message) {
  return Refusal(Refused::InvalidArgument, "REQUEST_INVALID", field + ": " + message).at(field);
}

Refusal no_job(const std::string& job_id) {
  return Refusal(Refused::NotFound, "JOB_NOT_FOUND", is_id(job_id) ? "there is no job " + job_id : "there is no such job").at("job_id");
}

bool is_final(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

// Equal requests have equal fingerprints, whether the surface came inline or as a blob.
std::string fingerprint_of(const v1::CreateJobRequest& request) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    request.SerializeToCodedStream(&coded);
  }
  wire::Sha256 sha;
  sha.add(bytes);
  return sha.finish();
}

void check_labels(const v1::CreateJobRequest& request) {
  if (request.request_id().size() > kMaxRequestId) throw invalid("request_id", "is longer than 128 characters");
  if (request.display_name().size() > kMaxDisplayName) throw invalid("display_name", "is longer than 256 characters");
  if (static_cast<int>(request.labels_size()) > kMaxLabels) throw invalid("labels", "are more than 32");
  for (const auto& [key, value] : request.labels())
    if (key.empty() || key.size() > kMaxLabel || value.size() > kMaxLabel)
      throw invalid("labels", "keys and values have 1 to 128 characters");
}

void check_outputs(v1::CreateJobRequest& request) {
  if (request.outputs().empty()) request.add_outputs(v1::OUTPUT_FORMAT_BLOCKS);
  std::set<int> seen;
  for (int i = 0; i < request.outputs_size(); ++i) {
    const std::string field = "outputs[" + std::to_string(i) + "]";
    const int format = request.outputs(i);
    if (format == v1::OUTPUT_FORMAT_UNSPECIFIED || !v1::OutputFormat_IsValid(format)) throw invalid(field, "is not a known format");
    if (!seen.insert(format).second) throw invalid(field, "is asked for twice");
  }
}

v1::JobError error_of(int code, const std::string& reason, const std::string& message) {
  v1::JobError error;
  error.set_code(code);
  error.set_reason(reason);
  error.set_message(message);
  error.mutable_diagnostic()->set_reason(reason);
  error.mutable_diagnostic()->set_severity(v1::SEVERITY_ERROR);
  error.mutable_diagnostic()->set_message(message);
  return error;
}

}  // namespace

JobDesk::JobDesk(JobStore& jobs, BlobStore& blobs, JobRunner& runner, MesherDoor mesher, DeskOptions options)
    : jobs_(jobs), blobs_(blobs), runner_(runner), mesher_(std::move(mesher)), options_(std::move(options)) {
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

template <class Request>
v1::MeshSpec JobDesk::checked_spec(const Request& request) const {
  v1::MeshSpec wire = request.has_spec_json() ? parse_spec(request.spec_json()) : request.spec();
  const MeshSpec spec = from_wire(wire);
  for (Diagnostic& finding : mesher_.check_spec(spec, {})) {
    // Which patches there are is known when the surface has been read.
    if (finding.severity != Severity::Error || finding.reason == Reason::PatchUnknown) continue;
    throw MeshError(Failure::InvalidInput, std::move(finding));
  }
  return to_wire(spec);
}
template v1::MeshSpec JobDesk::checked_spec(const v1::CreateJobRequest&) const;
template v1::MeshSpec JobDesk::checked_spec(const v1::ValidateJobRequest&) const;

void JobDesk::check_surface(const v1::Surface& surface) const {
  check_wire_surface(surface);
  switch (surface.source_case()) {
    case v1::Surface::SOURCE_NOT_SET: throw invalid("surface", "needs a blob_id or data");
    case v1::Surface::kData:
      if (static_cast<std::int64_t>(surface.data().size()) > options_.max_inline_surface_bytes)
        throw invalid("surface.data", "is larger than " + std::to_string(options_.max_inline_surface_bytes) + " bytes: upload it");
      return;
    case v1::Surface::kBlobId:
      if (!is_id(surface.blob_id()) || !blobs_.find(surface.blob_id()))
        throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "surface.blob_id: there is no such blob").at("surface.blob_id");
  }
}

void JobDesk::check_request(v1::CreateJobRequest& request) const {
  if (draining_) throw Refusal(Refused::Unavailable, "DRAINING", "the server is shutting down").retry_after(kRetrySeconds);
  check_labels(request);
  check_outputs(request);
  check_surface(request.surface());
  if (request.max_threads() < 0) throw invalid("max_threads", "must not be negative");
  if (!(request.time_limit_seconds() >= 0)) throw invalid("time_limit_seconds", "must not be negative");
  v1::MeshSpec spec = checked_spec(request);
  *request.mutable_spec() = std::move(spec);
}

std::optional<JobDesk::Created> JobDesk::known_request(const std::string& request_id, const std::string& fingerprint) const {
  if (request_id.empty()) return {};
  const auto known = jobs_.find_request(request_id);
  if (!known) return {};
  if (known->fingerprint == fingerprint) return Created{known->job, true};
  throw Refusal(Refused::AlreadyExists, "REQUEST_ID_REUSED", "request_id was used for another request, job " + known->job.job_id())
      .at("request_id");
}

void JobDesk::store_inline_surface(v1::CreateJobRequest& request) {
  if (!request.surface().has_data()) return;
  const auto writer = blobs_.create();
  writer->write(request.surface().data());
  request.mutable_surface()->set_blob_id(writer->publish().id);
}

JobDesk::Created JobDesk::create(v1::CreateJobRequest request) {
  const std::string fingerprint = fingerprint_of(request);
  if (auto known = known_request(request.request_id(), fingerprint)) return *known;
  check_request(request);
  {
    const Lock lock(mutex_);
    if (static_cast<int>(queue_.size()) >= options_.queue_capacity)
      throw Refusal(Refused::ResourceExhausted, "QUEUE_FULL", std::to_string(queue_.size()) + " jobs are waiting already")
          .retry_after(kRetrySeconds);
  }
  store_inline_surface(request);

  auto live = std::make_unique<Live>();
  v1::Job& job = live->stored.job;
  job.set_job_id(random_id());
  job.set_state(v1::JOB_STATE_QUEUED);
  job.set_display_name(request.display_name());
  *job.mutable_labels() = request.labels();
  *job.mutable_create_time() = now();
  *job.mutable_spec() = request.spec();
  job.set_generator(options_.generator);
  live->stored.request = std::move(request);
  live->stored.fingerprint = fingerprint;
  live->created = Clock::now();

  const Lock lock(mutex_);
  if (auto known = known_request(live->stored.request.request_id(), fingerprint)) return *known;
  v1::WatchJobResponse queued;
  queued.mutable_state_changed()->set_state(v1::JOB_STATE_QUEUED);
  jobs_.insert(live->stored, log(lock, *live, std::move(queued)));
  count_blobs(live->stored, +1);
  const std::string id = job.job_id();
  Live& kept = *(live_[id] = std::move(live));
  queue_.push_back(id);
  schedule(lock);
  return {shown(lock, kept), false};
}

void JobDesk::resume_stored_jobs() {
  const Lock lock(mutex_);
  for (StoredJob& stored : jobs_.all()) {
    count_blobs(stored, +1);
    if (is_final(stored.job.state())) continue;
    auto live = std::make_unique<Live>();
    const std::string id = stored.job.job_id();
    live->log = jobs_.events(id, 0);
    live->stored = std::move(stored);
    live->created = Clock::now();
    v1::Job& job = live->stored.job;
    if (job.state() == v1::JOB_STATE_RUNNING) {
      constexpr std::int64_t kProgressGap = 1'000'000;  // sequences the lost run may have given to progress events
      job.set_last_sequence(job.last_sequence() + kProgressGap);
      job.set_state(v1::JOB_STATE_QUEUED);
      job.clear_progress();
      v1::WatchJobResponse queued;
      queued.mutable_state_changed()->set_state(v1::JOB_STATE_QUEUED);
      const v1::WatchJobResponse& event = log(lock, *live, std::move(queued));
      jobs_.update(job, {event});
    }
    live_[id] = std::move(live);
    queue_.push_back(id);
  }
  schedule(lock);
}

// ---- running

void JobDesk::schedule(const Lock& lock) {
  while (running_ < runner_.slots() && !queue_.empty() && !draining_) {
    const std::string id = queue_.front();
    queue_.pop_front();
    start(lock, *live_.at(id));
  }
}

void JobDesk::start(const Lock& lock, Live& live) {
  ++running_;
  v1::Job& job = live.stored.job;
  const v1::CreateJobRequest& request = live.stored.request;
  const int threads = request.max_threads() > 0 ? std::min(request.max_threads(), options_.threads_per_job) : options_.threads_per_job;
  job.set_state(v1::JOB_STATE_RUNNING);
  job.set_threads(threads);
  job.set_attempt(1);
  *job.mutable_start_time() = now();
  live.started = Clock::now();
  job.mutable_usage()->set_queue_seconds(std::chrono::duration<double>(live.started - live.created).count());
  v1::WatchJobResponse running;
  running.mutable_state_changed()->set_state(v1::JOB_STATE_RUNNING);
  running.mutable_state_changed()->set_attempt(1);
  const v1::WatchJobResponse& event = log(lock, live, std::move(running));
  static_cast<void>(save(job, {event}));  // the end of the job is saved with all that came before
  const std::string id = job.job_id();
  runner_.start(
      {id, request, threads}, [this, id](v1::WatchJobResponse e) { happened(id, std::move(e)); },
      [this, id](v1::Job result) { finished(id, std::move(result)); });
}

v1::WatchJobResponse& JobDesk::log(const Lock&, Live& live, v1::WatchJobResponse event) {
  v1::Job& job = live.stored.job;
  job.set_last_sequence(job.last_sequence() + 1);
  event.set_sequence(job.last_sequence());
  *event.mutable_time() = now();
  if (event.has_progress()) {
    *job.mutable_progress() = event.progress();
    return live.progress.emplace(std::move(event));
  }
  return live.log.emplace_back(std::move(event));
}

void JobDesk::happened(const std::string& job_id, v1::WatchJobResponse event) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    const Lock lock(mutex_);
    const auto found = live_.find(job_id);
    if (found == live_.end()) return;
    Live& live = *found->second;
    const bool keep = !event.has_progress();
    note(live, event);
    const v1::WatchJobResponse& logged = log(lock, live, std::move(event));
    if (keep) static_cast<void>(save(live.stored.job, {logged}));
    watchers = live.watchers;
  }
  poke(std::move(watchers));
}

// What an event says about the job besides itself.
void JobDesk::note(Live& live, const v1::WatchJobResponse& event) {
  v1::Job& job = live.stored.job;
  if (event.has_estimate()) *job.mutable_estimate() = event.estimate();
  if (!event.has_state_changed()) return;
  job.set_attempt(event.state_changed().attempt());
  job.clear_progress();
  live.progress.reset();
}

void JobDesk::finished(const std::string& job_id, v1::Job result) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    const Lock lock(mutex_);
    --running_;
    const auto found = live_.find(job_id);
    const bool interrupted =
        closing_ && result.state() == v1::JOB_STATE_CANCELLED && found != live_.end() && !found->second->stored.job.cancel_requested();
    if (found != live_.end() && !interrupted) {  // an interrupted job stays RUNNING in the store and runs again after the restart
      watchers = found->second->watchers;
      finish(lock, *found->second, std::move(result));
    }
    schedule(lock);
    idle_.notify_all();
  }
  poke(std::move(watchers));
}

// The one place where a job becomes final.
void JobDesk::finish(const Lock& lock, Live& live, v1::Job result) {
  v1::Job& job = live.stored.job;
  if (live.out_of_time && result.state() == v1::JOB_STATE_CANCELLED) {
    const v1::JobError stopped = result.error();
    result.set_state(v1::JOB_STATE_FAILED);
    *result.mutable_error() = error_of(4, "TIME_BUDGET_EXCEEDED", "the job took longer than its time limit");
    result.mutable_error()->set_stage(stopped.stage());
    result.mutable_error()->set_backtrace(stopped.backtrace());
  }
  const double queued = job.usage().queue_seconds();
  job.MergeFrom(result);
  job.mutable_usage()->set_queue_seconds(queued);
  job.set_cancel_requested(false);
  *job.mutable_end_time() = now();
  if (job.state() == v1::JOB_STATE_SUCCEEDED && job.has_progress()) {
    job.mutable_progress()->set_fraction(1);
    job.mutable_progress()->set_stage_fraction(1);
    job.mutable_progress()->set_eta_seconds(0);
  }
  v1::WatchJobResponse ended;
  ended.mutable_state_changed()->set_state(job.state());
  log(lock, live, std::move(ended));
  for (const v1::Artifact& artifact : job.artifacts()) ++blob_uses_[artifact.blob().blob_id()];
  close(lock, live);
}

// Hands a final job over to the store alone.
void JobDesk::close(const Lock& lock, Live& live) {
  const std::string id = live.stored.job.job_id();
  const bool all_saved = live.unsaved ? save(live.stored.job, live.log) : save(live.stored.job, {live.log.back()});
  live.unsaved = !all_saved;
  if (live.unsaved) return;
  const bool remove = live.remove_when_done;
  live_.erase(id);
  if (remove) forget(lock, id);
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
  const auto place = std::find(queue_.begin(), queue_.end(), job.job_id());
  if (place != queue_.end()) job.set_queue_position(static_cast<int>(place - queue_.begin()));
  return job;
}

v1::Job JobDesk::get(const std::string& job_id) const {
  if (!is_id(job_id)) throw no_job(job_id);
  const Lock lock(mutex_);
  const auto found = live_.find(job_id);
  if (found != live_.end()) return shown(lock, *found->second);
  const auto stored = jobs_.find(job_id);
  if (!stored) throw no_job(job_id);
  return stored->job;
}

JobPage JobDesk::list(const v1::ListJobsRequest& request) const {
  if (request.page_size() < 0 || request.page_size() > kMaxPage) throw invalid("page_size", "must be 0 to 1000");
  const std::string& token = request.page_token();
  if (token.size() > 18 || token.find_first_not_of("0123456789") != std::string::npos)
    throw invalid("page_token", "is not one of this server's");
  const int size = request.page_size() == 0 ? kDefaultPage : request.page_size();
  JobPage page = jobs_.list(size, token, {request.states().begin(), request.states().end()});
  const Lock lock(mutex_);
  for (v1::Job& job : page.jobs) {
    const auto found = live_.find(job.job_id());
    if (found != live_.end()) job = without_details(shown(lock, *found->second));
  }
  return page;
}

v1::Job JobDesk::cancel(const std::string& job_id) {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    const Lock lock(mutex_);
    const auto found = live_.find(job_id);
    if (found != live_.end()) {
      Live& live = *found->second;
      watchers = live.watchers;
      const auto place = std::find(queue_.begin(), queue_.end(), job_id);
      if (place != queue_.end()) {
        queue_.erase(place);
        v1::Job result;
        result.set_state(v1::JOB_STATE_CANCELLED);
        *result.mutable_error() = error_of(1, "CANCELLED", "the job was cancelled before it ran");
        finish(lock, live, std::move(result));
      } else {
        live.stored.job.set_cancel_requested(true);
        runner_.cancel(job_id, Stop::Cancelled);
      }
    }
  }
  poke(std::move(watchers));
  return get(job_id);
}

void JobDesk::remove(const v1::DeleteJobRequest& request) {
  const std::string& id = request.job_id();
  {
    const Lock lock(mutex_);
    const auto found = live_.find(id);
    if (found == live_.end()) {
      if (is_id(id) && jobs_.find(id)) return forget(lock, id);
      if (request.allow_missing()) return;
      throw no_job(id);
    }
    if (!request.cancel_if_running())
      throw Refusal(Refused::FailedPrecondition, "JOB_NOT_FINISHED", "job " + id + " has not ended: cancel it first").at("job_id");
    found->second->remove_when_done = true;
  }
  try {
    cancel(id);
  } catch (const Refusal&) {
    // it is gone already: that was the order
  }
}

void JobDesk::forget(const Lock& lock, const std::string& job_id) {
  const auto stored = jobs_.find(job_id);
  if (!stored) return;
  jobs_.remove(job_id);
  release_blobs(lock, *stored);
}

void JobDesk::count_blobs(const StoredJob& stored, int change) {
  blob_uses_[stored.request.surface().blob_id()] += change;
  for (const v1::Artifact& artifact : stored.job.artifacts()) blob_uses_[artifact.blob().blob_id()] += change;
}

void JobDesk::release_blobs(const Lock&, const StoredJob& stored) {
  count_blobs(stored, -1);
  const auto drop = [&](const std::string& blob_id) {
    const auto uses = blob_uses_.find(blob_id);
    if (uses == blob_uses_.end() || uses->second > 0) return;
    blob_uses_.erase(uses);
    blobs_.remove(blob_id);
  };
  drop(stored.request.surface().blob_id());
  for (const v1::Artifact& artifact : stored.job.artifacts()) drop(artifact.blob().blob_id());
}

// ---- watching

void JobDesk::watch(const std::string& job_id, const std::weak_ptr<Watcher>& watcher) {
  const Lock lock(mutex_);
  watchers_.push_back(watcher);
  const auto found = live_.find(job_id);
  if (found != live_.end()) found->second->watchers.push_back(watcher);
}

News JobDesk::news(const std::string& job_id, std::int64_t after_sequence, bool with_progress) const {
  const Lock lock(mutex_);
  const auto found = live_.find(job_id);
  if (found == live_.end()) {
    auto stored = is_id(job_id) ? jobs_.find(job_id) : std::nullopt;
    if (!stored) throw no_job(job_id);
    return {jobs_.events(job_id, after_sequence), std::move(stored->job)};
  }
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

void JobDesk::poke(std::vector<std::weak_ptr<Watcher>> watchers) const {
  for (const std::weak_ptr<Watcher>& weak : watchers)
    if (const auto watcher = weak.lock()) watcher->poke();
}

void JobDesk::tick() {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    const Lock lock(mutex_);
    const Clock::time_point at = Clock::now();
    for (auto next = live_.begin(); next != live_.end();) {
      const auto here = next++;
      if (here->second->unsaved) close(lock, *here->second);
    }
    for (auto& [id, live] : live_) {
      if (live->stored.job.state() != v1::JOB_STATE_RUNNING || live->out_of_time) continue;
      double limit = live->stored.request.time_limit_seconds();
      if (options_.time_limit_seconds > 0 && (limit == 0 || options_.time_limit_seconds < limit)) limit = options_.time_limit_seconds;
      if (limit == 0 || std::chrono::duration<double>(at - live->started).count() < limit) continue;
      live->out_of_time = true;
      runner_.cancel(id, Stop::OutOfTime);
    }
    std::erase_if(watchers_, [](const std::weak_ptr<Watcher>& w) { return w.expired(); });
    watchers = watchers_;
  }
  poke(std::move(watchers));
}

// ---- going down

void JobDesk::drain() { draining_ = true; }

bool JobDesk::wait_idle(std::chrono::steady_clock::duration at_most) {
  Lock lock(mutex_);
  return idle_.wait_for(lock, at_most, [this] { return running_ == 0; });
}

JobDesk::Load JobDesk::load() const {
  const Lock lock(mutex_);
  return {running_, static_cast<int>(queue_.size()), jobs_.count()};
}

}  // namespace strata::server
