#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <utility>

#include "server/frames.h"
#include "server/ids.h"
#include "server/services.h"
#include "server/status.h"
#include "strata/v1/blob.grpc.pb.h"

namespace strata::server {
namespace {

using grpc::CallbackServerContext;

// What other tenants have does not exist for a caller.
BlobInfo blob_of(const Caller& caller, const BlobStore& blobs, const std::string& id) {
  const auto blob = is_id(id) ? blobs.find(id) : std::nullopt;
  if (!blob || !sees_blob(caller, *blob)) throw Refusal(Refused::NotFound, "BLOB_NOT_FOUND", "there is no such blob").at("blob_id");
  return *blob;
}

UploadInfo upload_of(const Caller& caller, const BlobStore& blobs, const std::string& id) {
  const auto upload = is_id(id) ? blobs.find_upload(id) : std::nullopt;
  if (!upload || (caller.role != Role::Admin && upload->owner != owner_key(caller.tenant)))
    throw Refusal(Refused::NotFound, "UPLOAD_NOT_FOUND", "there is no such upload").at("upload_id");
  return *upload;
}

// A call that ends before it began.
class RefusedWrite final : public grpc::ServerReadReactor<v1::WriteBlobRequest> {
 public:
  explicit RefusedWrite(const grpc::Status& status) { Finish(status); }
  void OnDone() override { delete this; }
};

// Takes one frame at a time; the next is read when this one is written.
class WriteCall final : public grpc::ServerReadReactor<v1::WriteBlobRequest> {
 public:
  WriteCall(const Caller& caller, BlobStore& blobs, std::unique_ptr<Transfers::Ticket> ticket, const WireLimits& limits,
            v1::WriteBlobResponse* response)
      : caller_(caller), blobs_(blobs), ticket_(std::move(ticket)), limits_(limits), response_(response) {
    read_next();
  }

  void OnReadDone(bool ok) override {
    ticket_->works();
    if (!ok) return Finish(status_of([&] { end(); }));
    const grpc::Status status = status_of([&] { take(); });
    if (status.ok()) return read_next();
    keep_what_came();
    Finish(status);
  }
  void OnDone() override { delete this; }

 private:
  void read_next() {
    ticket_->waits_for_client();
    StartRead(&request_);
  }

  void take() {
    if (upload_id_.empty()) {
      upload_id_ = request_.upload_id();
      static_cast<void>(upload_of(caller_, blobs_, upload_id_));
    }
    if (!request_.has_frame()) throw Refusal(Refused::InvalidArgument, "REQUEST_INVALID", "frame: is missing").at("frame");
    open_frame(*request_.mutable_frame(), limits_);
    blobs_.write_upload(upload_id_, request_.frame().offset(), request_.frame().data());
  }

  void end() {
    if (upload_id_.empty()) throw Refusal(Refused::InvalidArgument, "REQUEST_INVALID", "no message came").at("upload_id");
    const UploadInfo upload = blobs_.commit_upload(upload_id_);
    response_->set_committed_offset(upload.committed);
    if (upload.blob) *response_->mutable_blob() = to_wire(*upload.blob);
  }

  void keep_what_came() {
    if (blobs_.find_upload(upload_id_)) static_cast<void>(status_of([&] { blobs_.commit_upload(upload_id_); }));
  }

  const Caller caller_;
  BlobStore& blobs_;
  const std::unique_ptr<Transfers::Ticket> ticket_;
  const WireLimits& limits_;
  v1::WriteBlobResponse* response_;
  v1::WriteBlobRequest request_;
  std::string upload_id_;
};

// One outstanding write: gRPC's flow control holds the disk reads back.
class ReadCall final : public grpc::ServerWriteReactor<v1::ReadBlobResponse> {
 public:
  ReadCall(Gate& gate, CallbackServerContext& context, const BlobStore& blobs, Transfers& transfers, const v1::ReadBlobRequest& request) {
    const grpc::Status status = status_of([&] {
      const BlobInfo blob = blob_of(gate.admit(credentials_of(context), Role::Viewer, CallKind::Plain), blobs, request.blob_id());
      ticket_ = transfers.begin(context);
      open(blobs, blob, request);
    });
    if (status.ok()) write();
    else Finish(status);
  }

  void OnWriteDone(bool ok) override {
    ticket_->works();
    if (!ok || gone_) return Finish(grpc::Status::CANCELLED);
    if (!cutter_.more()) return Finish(grpc::Status::OK);
    const grpc::Status status = status_of([&] { cutter_.cut(*response_.mutable_frame()); });
    if (!status.ok()) return Finish(status);
    write();
  }
  void OnCancel() override { gone_ = true; }
  void OnDone() override { delete this; }

 private:
  void open(const BlobStore& blobs, const BlobInfo& blob, const v1::ReadBlobRequest& request) {
    if (request.offset() < 0 || request.offset() > blob.size)
      throw Refusal(Refused::OutOfRange, "OFFSET_OUT_OF_RANGE", "offset must be 0 to " + std::to_string(blob.size)).at("offset");
    if (request.limit() < 0) throw Refusal(Refused::InvalidArgument, "REQUEST_INVALID", "limit must not be negative").at("limit");
    const std::int64_t rest = blob.size - request.offset();
    const std::int64_t end = request.offset() + (request.limit() == 0 ? rest : std::min(request.limit(), rest));
    cutter_ = FrameCutter(blobs.open(blob.id), request.offset(), end, best_codec(request.accepted_codecs()));
    *response_.mutable_blob() = to_wire(blob);
  }

  void write() {
    ticket_->waits_for_client();
    StartWrite(&response_);
  }

  std::unique_ptr<Transfers::Ticket> ticket_;
  FrameCutter cutter_;
  v1::ReadBlobResponse response_;
  std::atomic<bool> gone_ = false;
};

class BlobService final : public v1::BlobService::CallbackService {
 public:
  BlobService(Gate& gate, const JobDesk& desk, BlobStore& blobs, Transfers& transfers, const WireLimits& limits)
      : gate_(gate), desk_(desk), blobs_(blobs), transfers_(transfers), limits_(limits) {}

  grpc::ServerUnaryReactor* StartUpload(CallbackServerContext* context, const v1::StartUploadRequest* request,
                                        v1::StartUploadResponse* response) override {
    return answer(context, Role::Submitter, [&](const Caller& caller) {
      check_upload(request->size_bytes(), request->sha256(), limits_);
      const std::string owner = owner_key(caller.tenant);
      const auto known = request->sha256().empty() ? std::nullopt : blobs_.find_digest(request->sha256(), owner);
      if (known && known->size == request->size_bytes()) {
        blobs_.touch(known->id);
        *response->mutable_blob() = to_wire(*known);
      } else {
        desk_.check_storage(caller.tenant, request->size_bytes());
        response->set_upload_id(blobs_.start_upload(request->size_bytes(), request->sha256(), owner).id);
        for (const v1::Codec codec : kCodecs) response->add_accepted_codecs(codec);
      }
    });
  }

  grpc::ServerReadReactor<v1::WriteBlobRequest>* WriteBlob(CallbackServerContext* context, v1::WriteBlobResponse* response) override {
    Caller caller;
    std::unique_ptr<Transfers::Ticket> ticket;
    const grpc::Status status = status_of([&] {
      caller = gate_.admit(credentials_of(*context), Role::Submitter, CallKind::Plain);
      ticket = transfers_.begin(*context);
    });
    if (!status.ok()) return new RefusedWrite(status);
    return new WriteCall(caller, blobs_, std::move(ticket), limits_, response);
  }

  grpc::ServerUnaryReactor* GetUpload(CallbackServerContext* context, const v1::GetUploadRequest* request,
                                      v1::GetUploadResponse* response) override {
    return answer(context, Role::Submitter, [&](const Caller& caller) {
      const UploadInfo upload = upload_of(caller, blobs_, request->upload_id());
      response->set_upload_id(upload.id);
      response->set_size_bytes(upload.size);
      response->set_committed_offset(upload.committed);
      for (const v1::Codec codec : kCodecs) response->add_accepted_codecs(codec);
      if (upload.blob) *response->mutable_blob() = to_wire(*upload.blob);
    });
  }

  grpc::ServerWriteReactor<v1::ReadBlobResponse>* ReadBlob(CallbackServerContext* context, const v1::ReadBlobRequest* request) override {
    return new ReadCall(gate_, *context, blobs_, transfers_, *request);
  }

  grpc::ServerUnaryReactor* GetBlob(CallbackServerContext* context, const v1::GetBlobRequest* request,
                                    v1::GetBlobResponse* response) override {
    return answer(context, Role::Viewer,
                  [&](const Caller& caller) { *response->mutable_blob() = to_wire(blob_of(caller, blobs_, request->blob_id())); });
  }

 private:
  template <class Body>
  grpc::ServerUnaryReactor* answer(CallbackServerContext* context, Role needed, const Body& body) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(status_of([&] { body(gate_.admit(credentials_of(*context), needed, CallKind::Plain)); }));
    return reactor;
  }

  Gate& gate_;
  const JobDesk& desk_;
  BlobStore& blobs_;
  Transfers& transfers_;
  const WireLimits limits_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_blob_service(Gate& gate, const JobDesk& desk, BlobStore& blobs, Transfers& transfers,
                                                 const WireLimits& limits) {
  return std::make_unique<BlobService>(gate, desk, blobs, transfers, limits);
}

}  // namespace strata::server
