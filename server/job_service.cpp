#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "core/base/parallel.h"
#include "server/convert.h"
#include "server/event_feed.h"
#include "server/frames.h"
#include "server/services.h"
#include "server/status.h"
#include "server/task_pool.h"
#include "strata/v1/job.grpc.pb.h"

namespace strata::server {
namespace {

using grpc::CallbackServerContext;

FeedOptions feed_options(const v1::WatchJobRequest& request) {
  FeedOptions options;
  if (request.after_sequence() < 0) throw invalid_field("after_sequence", "must not be negative");
  options.after_sequence = request.after_sequence();
  if (request.heartbeat_seconds() != 0) {
    if (!(request.heartbeat_seconds() >= 1 && request.heartbeat_seconds() <= 60))
      throw invalid_field("heartbeat_seconds", "must be 1 to 60");
    options.heartbeat = std::chrono::duration<double>(request.heartbeat_seconds());
  }
  if (request.min_interval_seconds() != 0) {
    if (!(request.min_interval_seconds() >= 0.1 && request.min_interval_seconds() <= 60))
      throw invalid_field("min_interval_seconds", "must be 0.1 to 60");
    options.min_interval = std::chrono::duration<double>(request.min_interval_seconds());
  }
  return options;
}

// A call that streams to its client one message at a time: `compose` gives the next one, when there is one. Pokes come from the desk.
// The call owns itself until OnDone; the desk only ever holds it weakly.
template <class Reactor, class Response>
class StreamingCall : public Reactor, public Watcher, public std::enable_shared_from_this<StreamingCall<Reactor, Response>> {
 public:
  void poke() final {
    std::optional<grpc::Status> ending;
    {
      const std::lock_guard lock(mutex_);
      if (!streaming_ || writing_ || finished_) return;
      bool composed = false;
      const grpc::Status status = gone_ ? grpc::Status::CANCELLED : status_of([&] { composed = compose(response_); });
      if (!status.ok()) ending = status;
      else if (composed) writing_ = true;
      else if (complete()) ending = final_status();
      else return;
      finished_ = ending.has_value();
    }
    // Last, and without the lock: the call may end, and this object with it, on another thread.
    if (ending) this->Finish(*ending);
    else this->StartWrite(&response_);
  }

  void OnWriteDone(bool ok) final {
    {
      const std::lock_guard lock(mutex_);
      writing_ = false;
      if (!ok) gone_ = true;
    }
    poke();
  }

  void OnCancel() final {
    client_left();
    {
      const std::lock_guard lock(mutex_);
      gone_ = true;
    }
    poke();
  }

  void OnDone() final { self_.reset(); }

 protected:
  void own_itself() { self_ = this->shared_from_this(); }
  void start_streaming() {
    {
      const std::lock_guard lock(mutex_);
      streaming_ = true;
    }
    poke();
  }
  void fail(const grpc::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (finished_) return;
      finished_ = true;
    }
    this->Finish(status);
  }

 private:
  virtual bool compose(Response& response) = 0;
  [[nodiscard]] virtual bool complete() const = 0;
  [[nodiscard]] virtual grpc::Status final_status() const { return grpc::Status::OK; }
  virtual void client_left() {}

  std::mutex mutex_;
  bool streaming_ = false, writing_ = false, finished_ = false, gone_ = false;
  Response response_;
  std::shared_ptr<StreamingCall> self_;
};

class WatchCall final : public StreamingCall<grpc::ServerWriteReactor<v1::WatchJobResponse>, v1::WatchJobResponse> {
 public:
  static WatchCall* begin(Gate& gate, const CallbackServerContext& context, JobDesk& desk, const v1::WatchJobRequest& request) {
    const auto call = std::make_shared<WatchCall>();
    call->own_itself();
    const grpc::Status status = status_of([&] {
      call->feed_.emplace(desk, request.job_id(), feed_options(request));
      desk.get(gate.admit(credentials_of(context), Role::Viewer, CallKind::Plain), request.job_id());
      desk.watch(request.job_id(), call);
    });
    if (status.ok()) call->start_streaming();
    else call->fail(status);
    return call.get();
  }

 private:
  bool compose(v1::WatchJobResponse& response) override {
    auto message = feed_->next();
    if (message) response = std::move(*message);
    return message.has_value();
  }
  bool complete() const override { return feed_->finished(); }

  std::optional<EventFeed> feed_;
};

// Surface up, events and artifacts down.
class GenerateCall final
    : public StreamingCall<grpc::ServerBidiReactor<v1::GenerateMeshRequest, v1::GenerateMeshResponse>, v1::GenerateMeshResponse> {
 public:
  GenerateCall(JobDesk& desk, BlobStore& blobs, const WireLimits& limits) : desk_(desk), blobs_(blobs), limits_(limits) {}

  static GenerateCall* begin(Gate& gate, const CallbackServerContext& context, JobDesk& desk, BlobStore& blobs, const WireLimits& limits) {
    const auto call = std::make_shared<GenerateCall>(desk, blobs, limits);
    call->own_itself();
    const grpc::Status status = status_of([&] { call->caller_ = gate.admit(credentials_of(context), Role::Submitter, CallKind::Submit); });
    if (status.ok()) call->StartRead(&call->request_);
    else call->fail(status);
    return call.get();
  }

  void OnReadDone(bool ok) override {
    const grpc::Status status = status_of([&] { ok ? take() : create(); });
    if (!status.ok()) return fail(status);
    if (ok) StartRead(&request_);
    else start_streaming();
  }

 private:
  void take() {
    if (request_.has_open()) return open();
    if (!opened_) throw invalid_field("open", "must be the first message");
    if (!request_.has_frame()) throw invalid_field("part", "is missing");
    if (upload_id_.empty()) throw invalid_field("open.surface_size_bytes", "announced no frames");
    check_frame(request_.frame(), limits_);
    upload_ = blobs_.write_upload(upload_id_, request_.frame().offset(), request_.frame().data());
  }

  void open() {
    if (opened_) throw invalid_field("open", "came twice");
    opened_ = true;
    open_ = request_.open();
    const bool has_source = open_.job().surface().source_case() != v1::Surface::SOURCE_NOT_SET;
    if (open_.surface_size_bytes() == 0) return;
    if (has_source) throw invalid_field("open.surface_size_bytes", "announces frames for a surface that is there already");
    check_upload(open_.surface_size_bytes(), open_.surface_sha256(), limits_);
    upload_id_ = blobs_.start_upload(open_.surface_size_bytes(), open_.surface_sha256(), owner_key(caller_.tenant)).id;
  }

  void create() {
    if (!opened_) throw invalid_field("open", "is missing");
    if (!upload_id_.empty()) {
      if (!upload_.blob) throw invalid_field("frame", "the surface ended before all of its bytes came");
      open_.mutable_job()->mutable_surface()->set_blob_id(upload_.blob->id);
    }
    const std::string job_id = desk_.create(caller_, open_.job()).job.job_id();
    {
      const std::lock_guard lock(job_mutex_);
      job_id_ = job_id;
    }
    feed_.emplace(desk_, job_id, FeedOptions{});
    desk_.watch(job_id, weak_from_this());
    if (client_gone_) client_left();
  }

  bool compose(v1::GenerateMeshResponse& response) override {
    response.Clear();
    if (!job_) return compose_event(response);
    if (artifact_ < job_->artifacts_size()) return compose_artifact(response);
    if (said_done_) return false;
    said_done_ = true;
    *response.mutable_done() = *job_;
    return true;
  }

  bool compose_event(v1::GenerateMeshResponse& response) {
    auto message = feed_->next();
    if (!message) return false;
    if (message->has_done()) {
      job_ = std::move(*message->mutable_done());
      return compose(response);
    }
    *response.mutable_event() = std::move(*message);
    return true;
  }

  bool compose_artifact(v1::GenerateMeshResponse& response) {
    const v1::Artifact& artifact = job_->artifacts(artifact_);
    if (!reader_) {
      reader_ = blobs_.open(artifact.blob().blob_id());
      at_ = 0;
      *response.mutable_artifact() = artifact;
    } else {
      fill_frame(*reader_, at_, artifact.blob().size_bytes(), *response.mutable_frame());
      at_ += static_cast<std::int64_t>(response.frame().data().size());
    }
    if (at_ == artifact.blob().size_bytes()) {
      reader_.reset();
      ++artifact_;
    }
    return true;
  }

  bool complete() const override { return said_done_; }
  grpc::Status final_status() const override { return job_->has_error() ? to_status(job_->error()) : grpc::Status::OK; }

  void client_left() override {
    client_gone_ = true;
    std::string job_id;
    {
      const std::lock_guard lock(job_mutex_);
      job_id = job_id_;
    }
    if (job_id.empty() || open_.detach_on_disconnect()) return;
    static_cast<void>(status_of([&] { desk_.cancel(caller_, job_id); }));
  }

  JobDesk& desk_;
  BlobStore& blobs_;
  const WireLimits& limits_;
  Caller caller_;
  v1::GenerateMeshRequest request_;
  v1::GenerateMeshOpen open_;
  bool opened_ = false;
  std::string upload_id_;
  UploadInfo upload_;
  std::mutex job_mutex_;
  std::string job_id_;
  std::atomic<bool> client_gone_ = false;
  std::optional<EventFeed> feed_;
  std::optional<v1::Job> job_;
  int artifact_ = 0;
  std::unique_ptr<BlobReader> reader_;
  std::int64_t at_ = 0;
  bool said_done_ = false;
};

// Checking a request reads the surface and builds the octree: too long for gRPC's threads.
class ValidateCall final : public grpc::ServerUnaryReactor {
 public:
  ValidateCall(Caller caller, const JobDesk& desk, BlobStore& blobs, const MesherDoor& mesher, const v1::ValidateJobRequest* request,
               v1::ValidateJobResponse* response)
      : caller_(std::move(caller)), desk_(desk), blobs_(blobs), mesher_(mesher), request_(request), response_(response) {}

  void run() {
    Finish(status_of([&] { validate(); }));
  }
  void OnCancel() override { cancelled_ = true; }
  void OnDone() override { delete this; }

 private:
  void validate() {
    desk_.admission().check_surface(caller_, request_->surface());
    try {
      *response_->mutable_effective_spec() = desk_.admission().checked_spec(*request_);
      TriangleSoup soup = read_wire_surface(request_->surface(), bytes());
      Context context(&cancelled_, {});
      CheckReport report;
      const MeshSpec spec = from_wire(response_->effective_spec());
      with_threads(desk_.options().threads_per_job, [&] { report = mesher_.check_request(std::move(soup), spec, context); });
      fill(report);
    } catch (const MeshError& error) {
      if (error.failure() != Failure::InvalidInput) throw;
      *response_->add_findings() = to_wire(error.diagnostic());
    }
  }

  std::vector<char> bytes() const {
    if (request_->surface().has_data()) return {request_->surface().data().begin(), request_->surface().data().end()};
    return read_all(blobs_, *blobs_.find(request_->surface().blob_id()));
  }

  void fill(const CheckReport& report) {
    bool acceptable = true;
    for (const Diagnostic& finding : report.findings) {
      acceptable = acceptable && finding.severity != Severity::Error;
      *response_->add_findings() = to_wire(finding);
    }
    response_->set_acceptable(acceptable);
    for (const std::string& name : report.patch_names) {
      v1::PatchReference& patch = *response_->add_patches();
      patch.set_name(name);
      patch.set_reference(response_->patches_size());
    }
    if (acceptable) *response_->mutable_estimate() = to_wire(report.estimate);
  }

  const Caller caller_;
  const JobDesk& desk_;
  BlobStore& blobs_;
  const MesherDoor& mesher_;
  const v1::ValidateJobRequest* request_;
  v1::ValidateJobResponse* response_;
  std::atomic<bool> cancelled_ = false;
};

class JobService final : public v1::JobService::CallbackService {
 public:
  JobService(Gate& gate, JobDesk& desk, BlobStore& blobs, const MesherDoor& mesher, const WireLimits& limits)
      : gate_(gate), desk_(desk), blobs_(blobs), mesher_(mesher), limits_(limits), checks_(kCheckThreads, kWaitingChecks) {}

  grpc::ServerUnaryReactor* CreateJob(CallbackServerContext* context, const v1::CreateJobRequest* request,
                                      v1::CreateJobResponse* response) override {
    return answer(context, Role::Submitter, CallKind::Submit, [&](const Caller& caller) {
      JobDesk::Created created = desk_.create(caller, *request);
      *response->mutable_job() = std::move(created.job);
      response->set_existing(created.existing);
    });
  }

  grpc::ServerUnaryReactor* ValidateJob(CallbackServerContext* context, const v1::ValidateJobRequest* request,
                                        v1::ValidateJobResponse* response) override {
    Caller caller;
    const grpc::Status status = status_of([&] { caller = gate_.admit(credentials_of(*context), Role::Submitter, CallKind::Plain); });
    auto* call = new ValidateCall(caller, desk_, blobs_, mesher_, request, response);
    if (!status.ok()) call->Finish(status);
    else if (!checks_.submit([call] { call->run(); }))
      call->Finish(to_status(Refusal(Refused::ResourceExhausted, "QUEUE_FULL", "too many checks are waiting").retry_after(2)));
    return call;
  }

  grpc::ServerUnaryReactor* GetJob(CallbackServerContext* context, const v1::GetJobRequest* request,
                                   v1::GetJobResponse* response) override {
    return answer(context, Role::Viewer, CallKind::Plain,
                  [&](const Caller& caller) { *response->mutable_job() = desk_.get(caller, request->job_id()); });
  }

  grpc::ServerUnaryReactor* ListJobs(CallbackServerContext* context, const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override {
    return answer(context, Role::Viewer, CallKind::Plain, [&](const Caller& caller) {
      JobPage page = desk_.list(caller, *request);
      for (v1::Job& job : page.jobs) *response->add_jobs() = std::move(job);
      response->set_next_page_token(page.next_token);
    });
  }

  grpc::ServerUnaryReactor* CancelJob(CallbackServerContext* context, const v1::CancelJobRequest* request,
                                      v1::CancelJobResponse* response) override {
    return answer(context, Role::Submitter, CallKind::Plain,
                  [&](const Caller& caller) { *response->mutable_job() = desk_.cancel(caller, request->job_id()); });
  }

  grpc::ServerUnaryReactor* DeleteJob(CallbackServerContext* context, const v1::DeleteJobRequest* request,
                                      v1::DeleteJobResponse*) override {
    return answer(context, Role::Submitter, CallKind::Plain, [&](const Caller& caller) { desk_.remove(caller, *request); });
  }

  grpc::ServerWriteReactor<v1::WatchJobResponse>* WatchJob(CallbackServerContext* context, const v1::WatchJobRequest* request) override {
    return WatchCall::begin(gate_, *context, desk_, *request);
  }

  grpc::ServerBidiReactor<v1::GenerateMeshRequest, v1::GenerateMeshResponse>* GenerateMesh(CallbackServerContext* context) override {
    return GenerateCall::begin(gate_, *context, desk_, blobs_, limits_);
  }

 private:
  static constexpr int kCheckThreads = 2;
  static constexpr std::size_t kWaitingChecks = 64;

  template <class Body>
  grpc::ServerUnaryReactor* answer(CallbackServerContext* context, Role needed, CallKind kind, const Body& body) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(status_of([&] { body(gate_.admit(credentials_of(*context), needed, kind)); }));
    return reactor;
  }

  Gate& gate_;
  JobDesk& desk_;
  BlobStore& blobs_;
  const MesherDoor mesher_;
  const WireLimits limits_;
  TaskPool checks_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_job_service(Gate& gate, JobDesk& desk, BlobStore& blobs, const MesherDoor& mesher,
                                                const WireLimits& limits) {
  return std::make_unique<JobService>(gate, desk, blobs, mesher, limits);
}

}  // namespace strata::server
