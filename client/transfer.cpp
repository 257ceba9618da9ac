#include "client/transfer.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include "client/exit_code.h"
#include "client/interrupt.h"
#include "client/status.h"
#include "proto/wire/crc32c.h"
#include "proto/wire/frame.h"
#include "proto/wire/sha256.h"

namespace strata::client {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kCallLimit{30};
constexpr std::int64_t kMostFrameBytes = std::int64_t{8} << 20;  // servers send 1 MiB

[[noreturn]] void local_failure(const std::string& what, const std::string& path) {
  throw CommandError(ExitCode::LocalIo, what + " '" + path + "': " + std::strerror(errno));
}

// Adds up to `most` bytes of the file to the digest, as many as there are; how many that was.
std::int64_t digest_file(const std::string& path, std::int64_t most, wire::Sha256& digest) {
  std::ifstream in(path, std::ios::binary);
  if (!in) local_failure("cannot read", path);
  std::string piece(static_cast<std::size_t>(wire::kFrameBytes), '\0');
  std::int64_t size = 0;
  while (in && size < most) {
    go_on();
    in.read(piece.data(), static_cast<std::streamsize>(std::min<std::int64_t>(most - size, wire::kFrameBytes)));
    digest.add({piece.data(), static_cast<std::size_t>(in.gcount())});
    size += in.gcount();
  }
  if (in.bad()) local_failure("cannot read", path);
  return size;
}

class Upload {
 public:
  Upload(Connection& connection, const std::string& path, const TransferProgress& progress)
      : connection_(connection), path_(path), progress_(progress) {
    wire::Sha256 digest;
    size_ = digest_file(path, std::numeric_limits<std::int64_t>::max(), digest);
    digest_ = digest.finish();
    if (size_ == 0) throw CommandError(ExitCode::InputRejected, "SURFACE_EMPTY: '" + path + "' is empty", "", "SURFACE_EMPTY");
  }

  std::string run(int retries) {
    Backoff backoff(retries);
    for (;;) {
      const std::int64_t before = offset_;
      grpc::Status status = upload_id_.empty() ? start() : locate();
      if (offset_ > before) backoff.reset();
      if (status.ok() && blob_id_.empty()) status = send();
      if (!blob_id_.empty()) return blob_id_;
      go_on();
      if (status.error_code() == grpc::NOT_FOUND && !upload_id_.empty()) upload_id_.clear();  // the server forgot it: from the start
      else if (!worth_another_try(status)) throw command_error(status, "uploading " + path_);
      if (!backoff.pause()) throw command_error(status, "uploading " + path_);
    }
  }

 private:
  static bool worth_another_try(const grpc::Status& status) {
    if (transient(status) || status.error_code() == grpc::OUT_OF_RANGE || status.error_code() == grpc::CANCELLED) return true;
    return status.error_code() == grpc::DATA_LOSS && command_error(status, "").reason() == "FRAME_CRC_MISMATCH";
  }

  grpc::Status start() {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kCallLimit);
    CallGuard guard(context);
    v1::StartUploadRequest request;
    request.set_size_bytes(size_);
    request.set_sha256(digest_);
    v1::StartUploadResponse response;
    const grpc::Status status = connection_.blobs->StartUpload(&context, request, &response);
    upload_id_ = response.upload_id();
    blob_id_ = response.blob().blob_id();
    offset_ = 0;
    agree(response.accepted_codecs());
    return status;
  }

  // Where to go on.
  grpc::Status locate() {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kCallLimit);
    CallGuard guard(context);
    v1::GetUploadRequest request;
    request.set_upload_id(upload_id_);
    v1::GetUploadResponse response;
    const grpc::Status status = connection_.blobs->GetUpload(&context, request, &response);
    if (!status.ok()) return status;
    blob_id_ = response.blob().blob_id();
    offset_ = response.committed_offset();
    agree(response.accepted_codecs());
    return status;
  }

  void agree(const google::protobuf::RepeatedField<int>& accepted) {
    const bool zstd = connection_.packs && std::find(accepted.begin(), accepted.end(), v1::CODEC_ZSTD) != accepted.end();
    codec_ = zstd ? v1::CODEC_ZSTD : v1::CODEC_UNSPECIFIED;
  }

  // From `offset_` to the end, as far as the connection holds.
  grpc::Status send() {
    std::ifstream in(path_, std::ios::binary);
    if (!in) local_failure("cannot read", path_);
    in.seekg(offset_);
    grpc::ClientContext context;
    CallGuard guard(context);
    v1::WriteBlobResponse response;
    const auto stream = connection_.blobs->WriteBlob(&context, &response);
    v1::WriteBlobRequest request;
    request.set_upload_id(upload_id_);
    std::int64_t offset = offset_;
    wire::PackingChoice choice(codec_);
    while (offset < size_) {
      const std::int64_t boundary = (offset / wire::kFrameBytes + 1) * wire::kFrameBytes;
      std::string& piece = *request.mutable_frame()->mutable_data();
      piece.resize(static_cast<std::size_t>(std::min(boundary, size_) - offset));
      if (!in.read(piece.data(), static_cast<std::streamsize>(piece.size()))) {
        context.TryCancel();
        throw CommandError(ExitCode::LocalIo, "'" + path_ + "' changed while it was read", "do not write to the file during the upload");
      }
      const auto size = static_cast<std::int64_t>(piece.size());
      request.mutable_frame()->set_offset(offset);
      wire::seal_frame(*request.mutable_frame(), choice.next());
      choice.sent(request.frame());
      if (!stream->Write(request)) break;
      guard.heard();
      offset += size;
      if (progress_) progress_(offset, size_);
    }
    stream->WritesDone();
    const grpc::Status status = stream->Finish();
    if (status.ok()) blob_id_ = response.blob().blob_id();
    return status;
  }

  Connection& connection_;
  const std::string path_;
  const TransferProgress& progress_;
  std::int64_t size_ = 0, offset_ = 0;  // `offset_`: what the server said it has
  std::string digest_, upload_id_, blob_id_;
  v1::Codec codec_ = v1::CODEC_UNSPECIFIED;
};

std::string part_of(const std::string& path) { return path + ".part"; }
// Beside the part: the id of the blob that it is a part of.
std::string note_of(const std::string& path) { return path + ".part.id"; }

class Download {
 public:
  Download(Connection& connection, const v1::Blob& blob, const std::string& path, const TransferProgress& progress)
      : connection_(connection), blob_(blob), path_(path), progress_(progress) {}

  // False: the bytes are not those of the blob.
  bool run(int retries) {
    open();
    Backoff backoff(retries);
    while (offset_ < blob_.size_bytes()) {
      const std::int64_t before = offset_;
      const grpc::Status status = receive();
      if (offset_ >= blob_.size_bytes()) break;
      out_.flush();
      go_on();
      if (!status.ok() && !transient(status) && status.error_code() != grpc::DATA_LOSS && status.error_code() != grpc::CANCELLED)
        throw command_error(status, doing());
      if (offset_ > before) backoff.reset();
      if (!backoff.pause())
        throw command_error(status.ok() ? grpc::Status(grpc::UNAVAILABLE, "the server stops sending") : status, doing());
    }
    out_.close();
    if (!out_) local_failure("cannot write", part_of(path_));
    return digest_.finish() == blob_.sha256();
  }

  // Some of the bytes are from an earlier run.
  [[nodiscard]] bool continued() const { return continued_; }
  [[nodiscard]] std::string doing() const { return "downloading to " + path_; }

  void finish() const {
    std::error_code error;
    fs::rename(part_of(path_), path_, error);
    if (error) throw CommandError(ExitCode::LocalIo, "cannot rename '" + part_of(path_) + "' to '" + path_ + "': " + error.message());
    fs::remove(note_of(path_), error);
  }

 private:
  void open() {
    const std::string part = part_of(path_);
    offset_ = bytes_there();
    if (offset_ > 0) offset_ = digest_file(part, offset_, digest_);
    continued_ = offset_ > 0;
    std::ofstream note(note_of(path_));
    note << blob_.blob_id() << '\n';
    note.close();
    out_.open(part, continued_ ? std::ios::binary | std::ios::in | std::ios::out : std::ios::binary | std::ios::out | std::ios::trunc);
    if (!out_ || !note) local_failure("cannot write", part);
    out_.seekp(offset_);
  }

  // A part counts only when the note beside it names this blob.
  [[nodiscard]] std::int64_t bytes_there() const {
    std::ifstream note(note_of(path_));
    std::string id;
    if (!(note >> id) || id != blob_.blob_id()) return 0;
    std::error_code error;
    const auto size = fs::file_size(part_of(path_), error);
    return error ? 0 : std::min<std::int64_t>(static_cast<std::int64_t>(size), blob_.size_bytes());
  }

  // From `offset_` as far as the connection holds.
  grpc::Status receive() {
    grpc::ClientContext context;
    CallGuard guard(context);
    v1::ReadBlobRequest request;
    request.set_blob_id(blob_.blob_id());
    request.set_offset(offset_);
    if (connection_.packs) request.add_accepted_codecs(v1::CODEC_ZSTD);
    const auto stream = connection_.blobs->ReadBlob(&context, request);
    v1::ReadBlobResponse response;
    bool damaged = false;
    while (!damaged && stream->Read(&response)) {
      guard.heard();
      if (!response.has_frame()) continue;
      v1::Frame& frame = *response.mutable_frame();
      damaged = frame.offset() != offset_ || wire::open_frame(frame, kMostFrameBytes) != wire::FrameFault::None;
      if (!damaged) accept(frame.data());
    }
    if (damaged) context.TryCancel();
    const grpc::Status status = stream->Finish();
    return damaged ? grpc::Status(grpc::DATA_LOSS, "a frame arrived damaged") : status;
  }

  void accept(const std::string& data) {
    if (!out_.write(data.data(), static_cast<std::streamsize>(data.size()))) local_failure("cannot write", part_of(path_));
    digest_.add(data);
    offset_ += static_cast<std::int64_t>(data.size());
    if (progress_) progress_(offset_, blob_.size_bytes());
  }

  Connection& connection_;
  const v1::Blob& blob_;
  const std::string path_;
  const TransferProgress& progress_;
  std::fstream out_;
  wire::Sha256 digest_;
  std::int64_t offset_ = 0;
  bool continued_ = false;
};

}  // namespace

std::string upload(Connection& connection, const std::string& path, int retries, const TransferProgress& progress) {
  return Upload(connection, path, progress).run(retries);
}

void download(Connection& connection, const v1::Blob& blob, const std::string& path, int retries, const TransferProgress& progress) {
  for (bool again = true; again;) {
    Download one(connection, blob, path, progress);
    if (one.run(retries)) return one.finish();
    again = one.continued();  // an old part was damaged: once more from the start
    discard_partial(path);
  }
  throw CommandError(ExitCode::Integrity, "the downloaded file has the wrong digest (while downloading to " + path + ")",
                     "run the command again");
}

void discard_partial(const std::string& path) {
  std::error_code ignored;
  fs::remove(part_of(path), ignored);
  fs::remove(note_of(path), ignored);
}

}  // namespace strata::client
