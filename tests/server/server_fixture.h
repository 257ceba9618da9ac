// A whole server in process over a Unix socket, with a mesher the tests can hold back.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "server/call_watch.h"
#include "server/server.h"
#include "strata/v1/blob.grpc.pb.h"
#include "strata/v1/job.grpc.pb.h"
#include "strata/v1/system.grpc.pb.h"
#include "tests/server/fake_mesher.h"

namespace strata::server {

struct TestOptions {
  int slots = 1;
  DeskOptions desk;
  WireLimits limits;
  std::string auth_file;
  std::string listen;  // besides the Unix socket; empty: nowhere
  int max_connections = 1000;
  int max_transfers = 1000;
  double stall_seconds = 120;
  std::string trace_file;  // empty: calls and jobs are not watched
};

class ServerFixture : public testing::Test {
 protected:
  void start(TestOptions options = {});
  void TearDown() override;

  // A job on the tetrahedron, inline.
  static v1::CreateJobRequest tetrahedron_job();
  v1::Job create(const v1::CreateJobRequest& request);
  v1::Job get(const std::string& job_id);
  v1::Job wait_final(const std::string& job_id);
  std::string upload(const std::string& bytes, std::size_t frame = 1 << 20);
  grpc::Status read(const std::string& blob_id, std::int64_t offset, std::string& bytes);

  FakeMesher mesher_;
  std::string folder_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> jobs_;
  MemoryLedger memory_{std::int64_t{1} << 30};
  std::unique_ptr<Metrics> metrics_;
  std::unique_ptr<Tracer> tracer_;
  std::unique_ptr<JobRunner> runner_, traced_;
  std::unique_ptr<Checker> checker_;
  std::unique_ptr<JobDesk> desk_;
  std::unique_ptr<Gate> gate_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::JobService::Stub> job_stub_;
  std::unique_ptr<v1::BlobService::Stub> blob_stub_;
  std::unique_ptr<v1::SystemService::Stub> system_stub_;
};

v1::Frame frame_of(std::int64_t offset, const std::string& data);
// ErrorInfo.reason of a status; the details' bytes must be within bounds.
std::string reason_of(const grpc::Status& status);
std::string field_of(const grpc::Status& status);
double retry_of(const grpc::Status& status);

}  // namespace strata::server
