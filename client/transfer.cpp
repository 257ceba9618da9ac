#include "client/transfer.h"

#include <fcntl.h>
#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "client/exit_code.h"
#include "client/status.h"
#include "proto/wire/crc32c.h"
#include "proto/wire/sha256.h"

namespace strata::client {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kFirstPause{200};
constexpr std::chrono::milliseconds kLongestPause{10000};

// Waits longer after each fruitless try; progress resets it.
class Backoff {
 public:
  explicit Backoff(int tries) : left_(tries), tries_(tries) {}
  bool pause() {
    if (left_-- <= 0) return false;
    std::this_thread::sleep_for(pause_);
    pause_ = std::min(2 * pause_, kLongestPause);
    return true;
  }
  void reset() {
    left_ = tries_;
    pause_ = kFirstPause;
  }

 private:
  int left_, tries_;
  std::chrono::milliseconds pause_ = kFirstPause;
};

[[noreturn]] void local_failure(const std::string& what, const std::string& path) {
  throw CommandError(ExitCode::LocalIo, what + " '" + path + "': " + std::strerror(errno));
}

std::string file_digest(const std::string& path, std::int64_t& size) {
  std::ifstream in(path, std::ios::binary);
  if (!in) local_failure("cannot read", path);
  wire::Sha256 digest;
  std::string piece(static_cast<std::size_t>(wire::kFrameBytes), '\0');
  size = 0;
  while (in) {
    in.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    digest.add({piece.data(), static_cast<std::size_t>(in.gcount())});
    size += in.gcount();
  }
  if (in.bad()) local_failure("cannot read", path);
  return digest.finish();
}

// Sends from `offset` to the end, as far as the connection holds.
grpc::Status send(Connection& connection, const std::string& upload_id, const std::string& path, std::int64_t offset, std::int64_t size,
                  const TransferProgress& progress, std::string& blob_id) {
  std::ifstream in(path, std::ios::binary);
  if (!in) local_failure("cannot read", path);
  in.seekg(offset);
  grpc::ClientContext context;
  v1::WriteBlobResponse response;
  const auto stream = connection.blobs->WriteBlob(&context, &response);
  std::string piece;
  bool first = true;
  while (offset < size) {
    const std::int64_t boundary = (offset / wire::kFrameBytes + 1) * wire::kFrameBytes;
    piece.resize(static_cast<std::size_t>(std::min(boundary, size) - offset));
    if (!in.read(piece.data(), static_cast<std::streamsize>(piece.size()))) {
      context.TryCancel();
      throw CommandError(ExitCode::LocalIo, "'" + path + "' changed while it was read", "do not write to the file during the upload");
    }
    v1::WriteBlobRequest request;
    if (first) request.set_upload_id(upload_id);
    first = false;
    v1::Frame& frame = *request.mutable_frame();
    frame.set_offset(offset);
    frame.set_crc32c(wire::crc32c(piece));
    frame.set_data(piece);
    if (!stream->Write(request)) break;
    offset += static_cast<std::int64_t>(piece.size());
    if (progress) progress(offset, size);
  }
  stream->WritesDone();
  const grpc::Status status = stream->Finish();
  if (status.ok()) blob_id = response.blob().blob_id();
  return status;
}

}  // namespace

std::string upload(Connection& connection, const std::string& path, int retries, const TransferProgress& progress) {
  const std::string doing = "uploading " + path;
  std::int64_t size = 0;
  const std::string digest = file_digest(path, size);
  if (size == 0) throw CommandError(ExitCode::InputRejected, "SURFACE_EMPTY: '" + path + "' is empty", "", "SURFACE_EMPTY");
  Backoff backoff(retries);
  v1::StartUploadResponse started;
  for (;;) {
    grpc::ClientContext context;
    v1::StartUploadRequest request;
    request.set_size_bytes(size);
    request.set_sha256(digest);
    const grpc::Status status = connection.blobs->StartUpload(&context, request, &started);
    if (status.ok()) break;
    if (!transient(status) || !backoff.pause()) throw command_error(status, doing);
  }
  if (started.has_blob()) return started.blob().blob_id();
  std::int64_t offset = 0;
  for (;;) {
    std::string blob_id;
    const grpc::Status status = send(connection, started.upload_id(), path, offset, size, progress, blob_id);
    if (status.ok() && !blob_id.empty()) return blob_id;
    if (!status.ok() && !transient(status) && status.error_code() != grpc::OUT_OF_RANGE) throw command_error(status, doing);
    for (;;) {  // where to go on
      grpc::ClientContext context;
      v1::GetUploadRequest request;
      request.set_upload_id(started.upload_id());
      v1::GetUploadResponse response;
      const grpc::Status asked = connection.blobs->GetUpload(&context, request, &response);
      if (asked.ok()) {
        if (response.has_blob()) return response.blob().blob_id();
        if (response.committed_offset() > offset) backoff.reset();
        offset = response.committed_offset();
        break;
      }
      if (!transient(asked) || !backoff.pause()) throw command_error(asked, doing);
    }
    if (!backoff.pause()) throw command_error(status, doing);
  }
}

void download(Connection& connection, const v1::Blob& blob, const std::string& path, int retries, const TransferProgress& progress) {
  const std::string doing = "downloading to " + path;
  const std::string part = path + ".part", note = path + ".part.id";
  // A partial file counts only when the note beside it names this blob.
  std::int64_t offset = 0;
  {
    std::ifstream in(note);
    std::string id;
    std::error_code error;
    if (in >> id && id == blob.blob_id() && fs::exists(part, error)) offset = std::min<std::int64_t>(static_cast<std::int64_t>(fs::file_size(part, error)), blob.size_bytes());
  }
  wire::Sha256 digest;
  if (offset > 0) {
    std::ifstream in(part, std::ios::binary);
    std::string piece(static_cast<std::size_t>(wire::kFrameBytes), '\0');
    std::int64_t left = offset;
    while (left > 0 && in.read(piece.data(), std::min<std::int64_t>(left, wire::kFrameBytes))) {
      digest.add({piece.data(), static_cast<std::size_t>(in.gcount())});
      left -= in.gcount();
    }
    if (left > 0) {
      offset = 0;
      digest = wire::Sha256();
    }
  }
  std::ofstream(note) << blob.blob_id() << '\n';
  std::ofstream out(part, offset > 0 ? std::ios::binary | std::ios::in | std::ios::out : std::ios::binary | std::ios::trunc);
  if (!out) local_failure("cannot write", part);
  out.seekp(offset);
  Backoff backoff(retries);
  while (offset < blob.size_bytes()) {
    grpc::ClientContext context;
    v1::ReadBlobRequest request;
    request.set_blob_id(blob.blob_id());
    request.set_offset(offset);
    const auto stream = connection.blobs->ReadBlob(&context, request);
    v1::ReadBlobResponse response;
    bool damaged = false;
    while (stream->Read(&response)) {
      if (!response.has_frame()) continue;
      const v1::Frame& frame = response.frame();
      if (frame.offset() != offset || wire::crc32c(frame.data()) != frame.crc32c()) {
        damaged = true;
        context.TryCancel();
        break;
      }
      if (!out.write(frame.data().data(), static_cast<std::streamsize>(frame.data().size()))) local_failure("cannot write", part);
      digest.add(frame.data());
      offset += static_cast<std::int64_t>(frame.data().size());
      backoff.reset();
      if (progress) progress(offset, blob.size_bytes());
    }
    const grpc::Status status = stream->Finish();
    if (offset >= blob.size_bytes()) break;
    if (!damaged && !status.ok() && !transient(status)) throw command_error(status, doing);
    if (!backoff.pause()) {
      if (damaged) throw CommandError(ExitCode::Integrity, "frames arrive damaged (while " + doing + ")", "check the network between client and server");
      throw command_error(status, doing);
    }
  }
  out.close();
  if (!out) local_failure("cannot write", part);
  if (digest.finish() != blob.sha256()) {
    fs::remove(part);
    fs::remove(note);
    throw CommandError(ExitCode::Integrity, "the downloaded file has the wrong digest (while " + doing + ")", "run the command again");
  }
  std::error_code error;
  fs::rename(part, path, error);
  if (error) throw CommandError(ExitCode::LocalIo, "cannot rename '" + part + "' to '" + path + "': " + error.message());
  fs::remove(note, error);
}

}  // namespace strata::client
