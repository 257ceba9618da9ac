// Uploads and downloads, through a real server in this process.
#include <thread>

#include "proto/wire/frame.h"
#include "proto/wire/sha256.h"
#include "server/ids.h"
#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;
using BlobRpc = ServerFixture;

TEST_F(BlobRpc, AnUploadedSurfaceIsMeshedAndKnownByItsDigest) {
  start();
  const std::string bytes = tetrahedron_job().surface().data();
  v1::CreateJobRequest request = tetrahedron_job();
  request.mutable_surface()->set_blob_id(upload(bytes, 10));
  EXPECT_EQ(wait_final(create(request).job_id()).state(), v1::JOB_STATE_SUCCEEDED);
  wire::Sha256 sha;
  sha.add(bytes);
  v1::StartUploadRequest again;
  again.set_size_bytes(static_cast<std::int64_t>(bytes.size()));
  again.set_sha256(sha.finish());
  v1::StartUploadResponse response;
  grpc::ClientContext context;
  EXPECT_TRUE(blob_stub_->StartUpload(&context, again, &response).ok());
  EXPECT_EQ(response.blob().blob_id(), request.surface().blob_id());
}

TEST_F(BlobRpc, AnUploadResumesAfterADamagedFrame) {
  start();
  v1::StartUploadRequest begin;
  begin.set_size_bytes(8);
  v1::StartUploadResponse begun;
  grpc::ClientContext c1, c2, c3, c4;
  ASSERT_TRUE(blob_stub_->StartUpload(&c1, begin, &begun).ok());
  v1::WriteBlobRequest request;
  request.set_upload_id(begun.upload_id());
  v1::WriteBlobResponse response;
  {
    const auto writer = blob_stub_->WriteBlob(&c2, &response);
    *request.mutable_frame() = frame_of(0, "0123");
    writer->Write(request);
    *request.mutable_frame() = frame_of(4, "4567");
    request.mutable_frame()->set_data("4X67");
    writer->Write(request);
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    EXPECT_EQ(status.error_code(), StatusCode::DATA_LOSS);
    EXPECT_EQ(reason_of(status), "FRAME_CRC_MISMATCH");
  }
  v1::GetUploadRequest where;
  where.set_upload_id(begun.upload_id());
  v1::GetUploadResponse at;
  ASSERT_TRUE(blob_stub_->GetUpload(&c3, where, &at).ok());
  EXPECT_EQ(at.committed_offset(), 4);
  const auto writer = blob_stub_->WriteBlob(&c4, &response);
  *request.mutable_frame() = frame_of(4, "4567");
  writer->Write(request);
  writer->WritesDone();
  ASSERT_TRUE(writer->Finish().ok());
  std::string bytes;
  EXPECT_TRUE(read(response.blob().blob_id(), 0, bytes).ok());
  EXPECT_EQ(bytes, "01234567");
}

TEST_F(BlobRpc, UploadsThatLieAreRefused) {
  start();
  const auto code_of = [&](std::int64_t size, const std::string& sha256) {
    v1::StartUploadRequest request;
    request.set_size_bytes(size);
    request.set_sha256(sha256);
    v1::StartUploadResponse response;
    grpc::ClientContext context;
    return blob_stub_->StartUpload(&context, request, &response).error_code();
  };
  EXPECT_EQ(code_of(0, ""), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code_of(-5, ""), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code_of(1, "short"), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code_of(std::int64_t{1} << 60, ""), StatusCode::INVALID_ARGUMENT);

  v1::StartUploadRequest begin;
  begin.set_size_bytes(4);
  begin.set_sha256(std::string(32, 'x'));
  v1::StartUploadResponse begun;
  grpc::ClientContext c1, c2;
  ASSERT_TRUE(blob_stub_->StartUpload(&c1, begin, &begun).ok());
  v1::WriteBlobResponse response;
  const auto writer = blob_stub_->WriteBlob(&c2, &response);
  v1::WriteBlobRequest request;
  request.set_upload_id(begun.upload_id());
  *request.mutable_frame() = frame_of(0, "evil");
  writer->Write(request);
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  EXPECT_EQ(status.error_code(), StatusCode::DATA_LOSS);
  EXPECT_EQ(reason_of(status), "DIGEST_MISMATCH");
}

TEST_F(BlobRpc, FramesThatCannotBeReadAreRefusedAndWhatCameBeforeStays) {
  start();
  v1::StartUploadRequest begin;
  begin.set_size_bytes(8000);
  v1::StartUploadResponse begun;
  grpc::ClientContext c1;
  ASSERT_TRUE(blob_stub_->StartUpload(&c1, begin, &begun).ok());
  ASSERT_EQ(begun.accepted_codecs_size(), 1);
  EXPECT_EQ(begun.accepted_codecs(0), v1::CODEC_ZSTD);
  v1::Frame good = frame_of(0, std::string(4000, 'a'));
  wire::seal_frame(good, v1::CODEC_ZSTD);
  ASSERT_EQ(good.codec(), v1::CODEC_ZSTD);
  const auto answer_to = [&](const v1::Frame& frame) {
    grpc::ClientContext context;
    v1::WriteBlobResponse response;
    const auto writer = blob_stub_->WriteBlob(&context, &response);
    v1::WriteBlobRequest request;
    request.set_upload_id(begun.upload_id());
    *request.mutable_frame() = frame;
    writer->Write(request);
    writer->WritesDone();
    return writer->Finish();
  };
  EXPECT_TRUE(answer_to(good).ok());
  v1::Frame bad = good;
  bad.set_offset(4000);
  bad.set_decoded_size(2'000'000'000);
  EXPECT_EQ(reason_of(answer_to(bad)), "FRAME_INVALID");
  bad.set_decoded_size(4001);
  EXPECT_EQ(reason_of(answer_to(bad)), "FRAME_CRC_MISMATCH");
  bad.set_codec(static_cast<v1::Codec>(9));
  const grpc::Status strange = answer_to(bad);
  EXPECT_EQ(strange.error_code(), StatusCode::UNIMPLEMENTED);
  EXPECT_EQ(reason_of(strange), "CODEC_UNSUPPORTED");
  v1::Frame rest = frame_of(4000, std::string(4000, 'b'));
  EXPECT_TRUE(answer_to(rest).ok()) << "plain after packed";
  v1::GetUploadRequest where;
  where.set_upload_id(begun.upload_id());
  v1::GetUploadResponse at;
  grpc::ClientContext c2;
  ASSERT_TRUE(blob_stub_->GetUpload(&c2, where, &at).ok());
  std::string bytes;
  EXPECT_TRUE(read(at.blob().blob_id(), 0, bytes).ok());
  EXPECT_TRUE(bytes == std::string(4000, 'a') + std::string(4000, 'b'));
}

TEST_F(BlobRpc, PackedDownloadsResumeAtAnyByte) {
  start();
  mesher_.hexes = 60'000;
  const v1::Blob blob = wait_final(create(tetrahedron_job()).job_id()).artifacts(0).blob();
  std::string all, rest;
  ASSERT_TRUE(read(blob.blob_id(), 0, all).ok());
  for (const std::int64_t offset :
       {std::int64_t{0}, std::int64_t{1}, (std::int64_t{1} << 20) - 1, (std::int64_t{1} << 20) + 1, blob.size_bytes() - 1}) {
    grpc::ClientContext context;
    v1::ReadBlobRequest request;
    request.set_blob_id(blob.blob_id());
    request.set_offset(offset);
    request.add_accepted_codecs(v1::CODEC_ZSTD);
    request.add_accepted_codecs(static_cast<v1::Codec>(99));  // of a client newer than the server
    const auto reader = blob_stub_->ReadBlob(&context, request);
    v1::ReadBlobResponse response;
    std::size_t sent = 0;
    rest.clear();
    while (reader->Read(&response)) {
      if (!response.has_frame()) continue;
      sent += response.frame().data().size();
      EXPECT_EQ(response.frame().offset(), offset + static_cast<std::int64_t>(rest.size()));
      ASSERT_EQ(wire::open_frame(*response.mutable_frame(), 1 << 20), wire::FrameFault::None);
      rest += response.frame().data();
    }
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_TRUE(rest == all.substr(static_cast<std::size_t>(offset))) << offset;
    EXPECT_LE(2 * sent, rest.size() + 2);
  }
}

TEST_F(BlobRpc, DownloadsResumeAtAnyByte) {
  start();
  mesher_.hexes = 60'000;  // a few MB, several frames
  const v1::Job job = wait_final(create(tetrahedron_job()).job_id());
  const v1::Blob& blob = job.artifacts(0).blob();
  std::string all;
  ASSERT_TRUE(read(blob.blob_id(), 0, all).ok());
  ASSERT_EQ(static_cast<std::int64_t>(all.size()), blob.size_bytes());
  ASSERT_GT(all.size(), std::size_t{3} << 20);
  for (const std::int64_t offset : {std::int64_t{1}, (std::int64_t{1} << 20) - 1, std::int64_t{1} << 20, blob.size_bytes()}) {
    std::string rest;
    EXPECT_TRUE(read(blob.blob_id(), offset, rest).ok());
    EXPECT_TRUE(rest == all.substr(static_cast<std::size_t>(offset))) << offset;
  }
  std::string none;
  EXPECT_EQ(read(blob.blob_id(), blob.size_bytes() + 1, none).error_code(), StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(read(blob.blob_id(), -1, none).error_code(), StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(read(random_id(), 0, none).error_code(), StatusCode::NOT_FOUND);
}

}  // namespace
}  // namespace strata::server
