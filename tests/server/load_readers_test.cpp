// Clients that stop reading.
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <numbers>
#include <random>
#include <thread>
#include <vector>

#include "server/ids.h"
#include "tests/server/load_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;

TEST_F(Load, ReadersThatStopReadingCostLittleAndHinderNobody) {
  const int stalled = is_long() ? 100 : 10;
  const std::int64_t size = (is_long() ? 1024 : 128) * kMiB;
  start({"--slots", "1"});
  v1::StartUploadRequest begin;
  begin.set_size_bytes(size);
  v1::StartUploadResponse begun;
  {
    grpc::ClientContext context;
    ASSERT_TRUE(blobs_->StartUpload(&context, begin, &begun).ok());
  }
  v1::WriteBlobResponse written;
  {
    grpc::ClientContext context;
    const auto writer = blobs_->WriteBlob(&context, &written);
    std::string piece(kMiB, 'x');
    std::mt19937_64 dice(1);
    for (std::int64_t at = 0; at < size; at += kMiB) {
      for (std::size_t i = 0; i + 8 <= piece.size(); i += 512) piece[i] = static_cast<char>(dice());
      v1::WriteBlobRequest request;
      request.set_upload_id(begun.upload_id());
      *request.mutable_frame() = frame_of(at, piece);
      ASSERT_TRUE(writer->Write(request));
    }
    writer->WritesDone();
    ASSERT_TRUE(writer->Finish().ok());
  }
  const auto download = [&] {
    const auto channel = daemon_->connect();
    const auto stub = v1::BlobService::NewStub(channel);
    grpc::ClientContext context;
    v1::ReadBlobRequest request;
    request.set_blob_id(written.blob().blob_id());
    const auto reader = stub->ReadBlob(&context, request);
    const auto started = Clock::now();
    std::int64_t got = 0;
    for (v1::ReadBlobResponse response; reader->Read(&response);) got += static_cast<std::int64_t>(response.frame().data().size());
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_EQ(got, size);
    return seconds_since(started);
  };
  download();
  const double alone = download();
  const std::int64_t before = daemon_->resident_bytes();
  struct Reader {
    std::shared_ptr<grpc::Channel> channel;
    std::unique_ptr<v1::BlobService::Stub> stub;
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::ReadBlobResponse>> stream;
  };
  std::vector<std::unique_ptr<Reader>> readers;
  v1::ReadBlobRequest request;
  request.set_blob_id(written.blob().blob_id());
  v1::ReadBlobResponse response;
  for (int i = 0; i < stalled; ++i) {
    readers.push_back(std::make_unique<Reader>());
    Reader& reader = *readers.back();
    reader.channel = daemon_->connect();
    reader.stub = v1::BlobService::NewStub(reader.channel);
    reader.stream = reader.stub->ReadBlob(&reader.context, request);
    ASSERT_TRUE(reader.stream->Read(&response));
    ASSERT_TRUE(reader.stream->Read(&response));
  }
  std::this_thread::sleep_for(is_long() ? 8s : 2s);
  const std::int64_t each = (daemon_->resident_bytes() - before) / stalled;
  const double beside = download();
  std::printf("%d stalled readers of %lld MiB: %.2f MiB of the server each; another download %.2f s, alone %.2f s\n", stalled,
              static_cast<long long>(size / kMiB), static_cast<double>(each) / kMiB, beside, alone);
  EXPECT_LT(each, 8 * kMiB);
  EXPECT_LT(beside, 3 * alone + 0.5 * slowness());
  for (const auto& reader : readers) reader->context.TryCancel();
  for (const auto& reader : readers) reader->stream->Finish();
}

}  // namespace
}  // namespace strata::server
