#include "server/generate_call.h"

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "server/event_feed.h"
#include "server/frames.h"
#include "server/status.h"
#include "server/streaming_call.h"

namespace strata::server {
namespace {

class GenerateCall final
    : public StreamingCall<grpc::ServerBidiReactor<v1::GenerateMeshRequest, v1::GenerateMeshResponse>, v1::GenerateMeshResponse> {
 public:
  GenerateCall(JobDesk& desk, BlobStore& blobs, TaskPool& pool, const WireLimits& limits)
      : desk_(desk), blobs_(blobs), pool_(pool), limits_(limits) {}

  // The first thing to be done with it.
  void begin(Gate& gate, grpc::CallbackServerContext& context, Transfers& transfers) {
    own_itself();
    const grpc::Status status = status_of([&] {
      caller_ = gate.admit(credentials_of(context), Role::Submitter, CallKind::Submit);
      ticket_ = transfers.begin(context);
    });
    if (status.ok()) read_next();
    else fail(status);
  }

  void OnReadDone(bool ok) override {
    ticket_->works();
    if (!ok) return end_of_surface();
    const grpc::Status status = status_of([&] { take(); });
    if (!status.ok()) return fail(status);
    read_next();
  }

 private:
  void read_next() {
    ticket_->waits_for_client();
    StartRead(&request_);
  }

  void take() {
    if (request_.has_open()) return open();
    if (!opened_) throw invalid_field("open", "must be the first message");
    if (!request_.has_frame()) throw invalid_field("part", "is missing");
    if (upload_id_.empty()) throw invalid_field("open.surface_size_bytes", "announced no frames");
    open_frame(*request_.mutable_frame(), limits_);
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
    desk_.check_storage(caller_.tenant, open_.surface_size_bytes());
    upload_id_ = blobs_.start_upload(open_.surface_size_bytes(), open_.surface_sha256(), owner_key(caller_.tenant)).id;
  }

  // Pricing a job takes its time: not on gRPC's threads.
  void end_of_surface() {
    if (desk_.prices_now() && pool_.submit([this] { create_and_stream(&client_gone_); })) return;
    create_and_stream(nullptr);
  }

  void create_and_stream(PriceUnless unless) {
    const grpc::Status status = status_of([&] { create(unless); });
    if (status.ok()) start_streaming();
    else fail(status);
  }

  void create(PriceUnless unless) {
    if (!opened_) throw invalid_field("open", "is missing");
    if (!upload_id_.empty()) {
      if (!upload_.blob) throw invalid_field("frame", "the surface ended before all of its bytes came");
      open_.mutable_job()->mutable_surface()->set_blob_id(upload_.blob->id);
    }
    const std::string job_id = desk_.create(caller_, open_.job(), unless).job.job_id();
    {
      const std::lock_guard lock(job_mutex_);
      job_id_ = job_id;
    }
    feed_.emplace(desk_, job_id, FeedOptions{});
    try {
      desk_.watch(job_id, weak_from_this());
    } catch (const Refusal&) {
      desk_.cancel(caller_, job_id);  // nobody would hear of its end
      throw;
    }
    if (client_gone_) client_left();
  }

  bool compose(v1::GenerateMeshResponse& response) override {
    ticket_->works();
    if (!compose_next(response)) return false;
    ticket_->waits_for_client();
    return true;
  }

  bool compose_next(v1::GenerateMeshResponse& response) {
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
      return compose_next(response);
    }
    *response.mutable_event() = std::move(*message);
    return true;
  }

  bool compose_artifact(v1::GenerateMeshResponse& response) {
    const v1::Artifact& artifact = job_->artifacts(artifact_);
    if (!cutter_) {
      const v1::Codec codec = best_codec(open_.accepted_codecs());
      cutter_.emplace(blobs_.open(artifact.blob().blob_id()), 0, artifact.blob().size_bytes(), codec);
      *response.mutable_artifact() = artifact;
    } else {
      cutter_->cut(*response.mutable_frame());
    }
    if (!cutter_->more()) {
      cutter_.reset();
      ++artifact_;
    }
    return true;
  }

  bool complete() const override { return said_done_; }
  grpc::Status final_status() const override { return job_->has_error() ? to_status(job_->error()) : grpc::Status::OK; }

  void over() override { ticket_.reset(); }

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
  TaskPool& pool_;
  const WireLimits& limits_;
  Caller caller_;
  std::unique_ptr<Transfers::Ticket> ticket_;
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
  std::optional<FrameCutter> cutter_;
  bool said_done_ = false;
};

}  // namespace

grpc::ServerBidiReactor<v1::GenerateMeshRequest, v1::GenerateMeshResponse>* begin_generate(Gate& gate, grpc::CallbackServerContext& context,
                                                                                           JobDesk& desk, BlobStore& blobs,
                                                                                           Transfers& transfers, TaskPool& pool,
                                                                                           const WireLimits& limits) {
  const auto call = std::make_shared<GenerateCall>(desk, blobs, pool, limits);
  call->begin(gate, context, transfers);
  return call.get();
}

}  // namespace strata::server
