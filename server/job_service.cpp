#include <grpcpp/grpcpp.h>

#include <atomic>
#include <memory>
#include <optional>
#include <utility>

#include "server/event_feed.h"
#include "server/generate_call.h"
#include "server/services.h"
#include "server/status.h"
#include "server/streaming_call.h"
#include "server/task_pool.h"
#include "strata/v1/job.grpc.pb.h"

namespace strata::server {
namespace {

using grpc::CallbackServerContext;

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

// A call that takes its time. Its body runs on a pool: gRPC's own threads are for those that do not.
class SlowCall final : public grpc::ServerUnaryReactor {
 public:
  template <class Body>
  void run(const Body& body) {
    Finish(status_of([&] { body(std::as_const(cancelled_)); }));  // last: it may be gone then
  }
  void OnCancel() override { cancelled_ = true; }
  void OnDone() override { delete this; }

 private:
  std::atomic<bool> cancelled_ = false;
};

class JobService final : public v1::JobService::CallbackService {
 public:
  JobService(Gate& gate, JobDesk& desk, BlobStore& blobs, Transfers& transfers, const WireLimits& limits)
      : gate_(gate), desk_(desk), blobs_(blobs), transfers_(transfers), limits_(limits), pool_(kSlowCalls, kWaitingCalls) {}

  grpc::ServerUnaryReactor* CreateJob(CallbackServerContext* context, const v1::CreateJobRequest* request,
                                      v1::CreateJobResponse* response) override {
    Caller caller;
    const grpc::Status status = status_of([&] { caller = gate_.admit(credentials_of(*context), Role::Submitter, CallKind::Submit); });
    auto* call = new SlowCall;
    const auto create = [this, caller, request, response](PriceUnless unless) {
      JobDesk::Created created = desk_.create(caller, *request, unless);
      *response->mutable_job() = std::move(created.job);
      response->set_existing(created.existing);
    };
    if (!status.ok()) call->Finish(status);
    else if (!desk_.prices_now() || !pool_.submit([=] { call->run([&](const std::atomic<bool>& cancelled) { create(&cancelled); }); }))
      call->run([&](const auto&) { create(nullptr); });
    return call;
  }

  grpc::ServerUnaryReactor* ValidateJob(CallbackServerContext* context, const v1::ValidateJobRequest* request,
                                        v1::ValidateJobResponse* response) override {
    Caller caller;
    const grpc::Status status = status_of([&] { caller = gate_.admit(credentials_of(*context), Role::Submitter, CallKind::Plain); });
    auto* call = new SlowCall;
    const auto validate = [this, caller, request, response](const std::atomic<bool>& cancelled) {
      *response = desk_.admission().validate(caller, *request, cancelled);
    };
    if (!status.ok()) call->Finish(status);
    else if (!pool_.submit([=] { call->run(validate); }))
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
    return begin_generate(gate_, *context, desk_, blobs_, transfers_, pool_, limits_);
  }

 private:
  static constexpr int kSlowCalls = 2;
  static constexpr std::size_t kWaitingCalls = 64;

  template <class Body>
  grpc::ServerUnaryReactor* answer(CallbackServerContext* context, Role needed, CallKind kind, const Body& body) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(status_of([&] { body(gate_.admit(credentials_of(*context), needed, kind)); }));
    return reactor;
  }

  Gate& gate_;
  JobDesk& desk_;
  BlobStore& blobs_;
  Transfers& transfers_;
  const WireLimits limits_;
  TaskPool pool_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_job_service(Gate& gate, JobDesk& desk, BlobStore& blobs, Transfers& transfers,
                                                const WireLimits& limits) {
  return std::make_unique<JobService>(gate, desk, blobs, transfers, limits);
}

}  // namespace strata::server
