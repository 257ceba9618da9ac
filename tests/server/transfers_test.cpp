// Uploads and downloads whose clients stop, and too many of them.
#include <string>
#include <thread>

#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;

constexpr std::size_t kMuch = 32 << 20;  // more than gRPC holds between the two ends

class TransfersTest : public ServerFixture {
 protected:
  void start_with(double stall_seconds, int most = 1000) {
    TestOptions options;
    options.stall_seconds = stall_seconds;
    options.max_transfers = most;
    start(options);
  }

  std::string stored(const std::string& bytes) {
    const auto writer = blobs_->create("");
    writer->write(bytes);
    return writer->publish().id;
  }

  struct Reading {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::ReadBlobResponse>> reader;
    std::string bytes;

    bool take() {
      v1::ReadBlobResponse response;
      if (!reader->Read(&response)) return false;
      bytes += response.frame().data();
      return true;
    }
  };
  std::unique_ptr<Reading> begin_reading(const std::string& blob_id) {
    auto reading = std::make_unique<Reading>();
    v1::ReadBlobRequest request;
    request.set_blob_id(blob_id);
    reading->reader = blob_stub_->ReadBlob(&reading->context, request);
    return reading;
  }

  std::string start_upload(std::int64_t size) {
    grpc::ClientContext context;
    v1::StartUploadRequest request;
    request.set_size_bytes(size);
    v1::StartUploadResponse response;
    EXPECT_TRUE(blob_stub_->StartUpload(&context, request, &response).ok());
    return response.upload_id();
  }
};

std::string some_bytes(std::size_t size) {
  std::string bytes(size, 0);
  std::uint32_t state = 1;
  for (char& byte : bytes) byte = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  return bytes;
}

TEST_F(TransfersTest, ADownloadWhoseClientStopsIsEndedAndGoesOnLater) {
  start_with(0.4);
  const std::string bytes = some_bytes(kMuch);
  const std::string blob = stored(bytes);
  const auto reading = begin_reading(blob);
  ASSERT_TRUE(reading->take());
  std::this_thread::sleep_for(1500ms);
  while (reading->take()) {
  }
  EXPECT_EQ(reading->reader->Finish().error_code(), StatusCode::CANCELLED);
  ASSERT_LT(reading->bytes.size(), bytes.size());
  std::string rest;
  EXPECT_TRUE(read(blob, static_cast<std::int64_t>(reading->bytes.size()), rest).ok());
  EXPECT_TRUE(reading->bytes + rest == bytes);
}

TEST_F(TransfersTest, ADownloadThatIsSlowIsNotEnded) {
  start_with(1);
  const std::string bytes = some_bytes(kMuch);
  const auto reading = begin_reading(stored(bytes));
  while (reading->take()) std::this_thread::sleep_for(60ms);  // 2 s together
  EXPECT_TRUE(reading->reader->Finish().ok());
  EXPECT_TRUE(reading->bytes == bytes);
}

TEST_F(TransfersTest, AnUploadWhoseClientStopsIsEndedAndKeepsWhatCame) {
  start_with(0.4);
  const std::string upload = start_upload(8);
  grpc::ClientContext context;
  v1::WriteBlobResponse response;
  const auto writer = blob_stub_->WriteBlob(&context, &response);
  v1::WriteBlobRequest request;
  request.set_upload_id(upload);
  *request.mutable_frame() = frame_of(0, "0123");
  ASSERT_TRUE(writer->Write(request));
  EXPECT_EQ(writer->Finish().error_code(), StatusCode::CANCELLED);  // without a word that it is done
  // The client hears of it before the server has put away what came.
  for (int i = 0; i < 1000 && blobs_->find_upload(upload)->committed == 0; ++i) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(blobs_->find_upload(upload)->committed, 4);
}

TEST_F(TransfersTest, ACallThatWaitsForItsJobIsNotEnded) {
  start_with(0.3);
  mesher_.hold();
  grpc::ClientContext context;
  const auto stream = job_stub_->GenerateMesh(&context);
  v1::GenerateMeshRequest request;
  *request.mutable_open()->mutable_job() = tetrahedron_job();
  ASSERT_TRUE(stream->Write(request));
  ASSERT_TRUE(stream->WritesDone());
  std::thread later([this] {
    std::this_thread::sleep_for(1200ms);
    mesher_.release();
  });
  v1::GenerateMeshResponse response;
  bool done = false;
  while (stream->Read(&response)) done = done || response.has_done();
  later.join();
  EXPECT_TRUE(done);
  EXPECT_TRUE(stream->Finish().ok());
}

TEST_F(TransfersTest, MoreThanTheLimitAreToldToComeBack) {
  start_with(120, 2);
  const std::string blob = stored(some_bytes(kMuch));
  const auto one = begin_reading(blob), two = begin_reading(blob);
  ASSERT_TRUE(one->take());
  ASSERT_TRUE(two->take());
  const auto three = begin_reading(blob);
  EXPECT_FALSE(three->take());
  const grpc::Status refused = three->reader->Finish();
  EXPECT_EQ(refused.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(reason_of(refused), "TOO_MANY_TRANSFERS");
  EXPECT_GT(retry_of(refused), 0);
  one->context.TryCancel();
  EXPECT_EQ(one->reader->Finish().error_code(), StatusCode::CANCELLED);
  std::string bytes;
  bool again = false;
  for (int i = 0; i < 100 && !again; ++i, std::this_thread::sleep_for(20ms)) again = read(blob, 0, bytes = "").ok();
  EXPECT_TRUE(again);
  two->context.TryCancel();
}

}  // namespace
}  // namespace strata::server
