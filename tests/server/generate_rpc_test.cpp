// GenerateMesh, through a real server in this process.
#include <thread>

#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;
using GenerateRpc = ServerFixture;

TEST_F(GenerateRpc, GenerateMeshDoesAllInOneCall) {
  start();
  grpc::ClientContext context;
  const auto stream = job_stub_->GenerateMesh(&context);
  const std::string bytes = tetrahedron_job().surface().data();
  v1::GenerateMeshRequest request;
  *request.mutable_open()->mutable_job() = tetrahedron_job();
  request.mutable_open()->mutable_job()->mutable_surface()->clear_source();
  request.mutable_open()->set_surface_size_bytes(static_cast<std::int64_t>(bytes.size()));
  stream->Write(request);
  *request.mutable_frame() = frame_of(0, bytes.substr(0, 20));
  stream->Write(request);
  *request.mutable_frame() = frame_of(20, bytes.substr(20));
  stream->Write(request);
  stream->WritesDone();
  v1::GenerateMeshResponse response;
  std::string mesh;
  v1::Artifact artifact;
  v1::Job done;
  while (stream->Read(&response)) {
    if (response.has_artifact()) artifact = response.artifact();
    if (response.has_frame()) mesh += response.frame().data();
    if (response.has_done()) done = response.done();
  }
  EXPECT_TRUE(stream->Finish().ok());
  EXPECT_EQ(done.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(artifact.format(), v1::OUTPUT_FORMAT_BLOCKS);
  EXPECT_EQ(static_cast<std::int64_t>(mesh.size()), artifact.blob().size_bytes());
}

TEST_F(GenerateRpc, GenerateMeshEndsWithTheErrorOfTheJob) {
  start();
  grpc::ClientContext context;
  const auto stream = job_stub_->GenerateMesh(&context);
  v1::GenerateMeshRequest request;
  *request.mutable_open()->mutable_job() = tetrahedron_job();
  request.mutable_open()->mutable_job()->mutable_surface()->set_data("OFF\nnonsense");
  stream->Write(request);
  stream->WritesDone();
  v1::GenerateMeshResponse response, last;
  while (stream->Read(&response)) last = response;
  EXPECT_TRUE(last.has_done());
  const grpc::Status status = stream->Finish();
  EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(reason_of(status), "FILE_MALFORMED");
}

TEST_F(GenerateRpc, GenerateMeshCancelsTheJobWhenTheClientLeaves) {
  start();
  mesher_.hold();
  {
    grpc::ClientContext context;
    const auto stream = job_stub_->GenerateMesh(&context);
    v1::GenerateMeshRequest request;
    *request.mutable_open()->mutable_job() = tetrahedron_job();
    stream->Write(request);
    stream->WritesDone();
    v1::GenerateMeshResponse response;
    while (desk_->load().running == 0) ASSERT_TRUE(stream->Read(&response));
    context.TryCancel();
  }
  EXPECT_TRUE(desk_->wait_idle(1s));
}

TEST_F(GenerateRpc, GenerateMeshRefusesFramesOutOfOrderOrWithoutOpen) {
  start();
  const auto code_of = [&](const std::vector<v1::GenerateMeshRequest>& requests) {
    grpc::ClientContext context;
    const auto stream = job_stub_->GenerateMesh(&context);
    for (const auto& request : requests) stream->Write(request);
    stream->WritesDone();
    v1::GenerateMeshResponse response;
    while (stream->Read(&response)) {
    }
    return stream->Finish().error_code();
  };
  v1::GenerateMeshRequest frame, open;
  *frame.mutable_frame() = frame_of(5, "x");
  *open.mutable_open()->mutable_job() = tetrahedron_job();
  open.mutable_open()->mutable_job()->mutable_surface()->clear_source();
  open.mutable_open()->set_surface_size_bytes(10);
  EXPECT_EQ(code_of({frame}), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code_of({}), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code_of({open, frame}), StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(code_of({open}), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(code_of({open, open}), StatusCode::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace strata::server
