// Jobs and the server itself, through a real server in this process.
#include <filesystem>
#include <thread>

#include "core/base/stage.h"
#include "proto/wire/sha256.h"
#include "server/ids.h"
#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;
using Rpc = ServerFixture;

TEST_F(Rpc, AJobRunsAndItsRecordHoldsTheReport) {
  start();
  v1::CreateJobRequest request = tetrahedron_job();
  request.add_outputs(v1::OUTPUT_FORMAT_BLOCKS);
  request.add_outputs(v1::OUTPUT_FORMAT_MESH);
  request.set_display_name("tet");
  (*request.mutable_labels())["case"] = "a7";
  const v1::Job job = wait_final(create(request).job_id());
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(job.display_name(), "tet");
  EXPECT_EQ(job.labels().at("case"), "a7");
  EXPECT_EQ(job.rung(), v1::RUNG_LAYERS_THINNED);
  EXPECT_EQ(job.hexes(), 1);
  EXPECT_EQ(job.threads(), 1);
  EXPECT_EQ(job.generator(), "test");
  ASSERT_EQ(job.patches_size(), 1);
  EXPECT_EQ(job.patches(0).reference(), 1);
  ASSERT_EQ(job.adjustments_size(), 1);
  EXPECT_EQ(job.adjustments(0).reason(), "LAYERS_THINNED");
  EXPECT_EQ(job.stages(0).stage(), v1::STAGE_READ);
  EXPECT_EQ(job.stages().rbegin()->stage(), v1::STAGE_WRITE);
  EXPECT_EQ(job.progress().fraction(), 1);
  EXPECT_GT(job.usage().peak_memory_bytes(), 0);
  ASSERT_EQ(job.artifacts_size(), 2);
  EXPECT_EQ(job.artifacts(0).blocks().hex_count(), 1);
  std::string bytes;
  EXPECT_TRUE(read(job.artifacts(1).blob().blob_id(), 0, bytes).ok());
  EXPECT_NE(bytes.find("Hexahedra"), std::string::npos);
  wire::Sha256 sha;
  sha.add(bytes);
  EXPECT_EQ(sha.finish(), job.artifacts(1).blob().sha256());
}

TEST_F(Rpc, BadRequestsAreRefusedWithReasonAndField) {
  start();
  const auto refused = [&](const auto& change) {
    v1::CreateJobRequest request = tetrahedron_job();
    change(request);
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    const grpc::Status status = job_stub_->CreateJob(&context, request, &response);
    return std::to_string(status.error_code()) + " " + reason_of(status) + " " + field_of(status);
  };
  EXPECT_EQ(refused([](auto& r) { r.set_spec_json(R"({"layers":[{"patches":["a"],"frist_height":1}]})"); }),
            "3 SPEC_INVALID layers[0].frist_height");
  EXPECT_EQ(refused([](auto& r) { r.mutable_spec()->mutable_sizing()->set_max_size(-1); }), "3 SPEC_INVALID sizing.max_size");
  EXPECT_EQ(refused([](auto& r) { r.mutable_surface()->clear_source(); }), "3 REQUEST_INVALID surface");
  EXPECT_EQ(refused([](auto& r) { r.mutable_surface()->clear_format(); }), "3 FORMAT_UNKNOWN surface.format");
  EXPECT_EQ(refused([](auto& r) { r.mutable_surface()->set_blob_id(random_id()); }), "5 BLOB_NOT_FOUND surface.blob_id");
  EXPECT_EQ(refused([](auto& r) { r.mutable_surface()->set_blob_id("../../etc/passwd"); }), "5 BLOB_NOT_FOUND surface.blob_id");
  EXPECT_EQ(refused([](auto& r) { r.mutable_surface()->set_data(std::string(2 << 20, ' ')); }), "3 REQUEST_INVALID surface.data");
  EXPECT_EQ(refused([](auto& r) { r.add_outputs(v1::OUTPUT_FORMAT_UNSPECIFIED); }), "3 REQUEST_INVALID outputs[0]");
  EXPECT_EQ(refused([](auto& r) { r.add_outputs(v1::OUTPUT_FORMAT_VTU), r.add_outputs(v1::OUTPUT_FORMAT_VTU); }),
            "3 REQUEST_INVALID outputs[1]");
  EXPECT_EQ(refused([](auto& r) { r.set_max_threads(-1); }), "3 REQUEST_INVALID max_threads");
  EXPECT_EQ(refused([](auto& r) { r.set_time_limit_seconds(-1); }), "3 REQUEST_INVALID time_limit_seconds");
  EXPECT_EQ(refused([](auto& r) { r.set_request_id(std::string(200, 'x')); }), "3 REQUEST_INVALID request_id");
}

TEST_F(Rpc, AMalformedSurfaceFailsTheJobWithTheReasonNotTheServer) {
  start();
  v1::CreateJobRequest request = tetrahedron_job();
  request.mutable_surface()->set_data("OFF\nnonsense");
  const v1::Job job = wait_final(create(request).job_id());
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().code(), 3);
  EXPECT_EQ(job.error().reason(), "FILE_MALFORMED");
  EXPECT_EQ(job.error().stage(), v1::STAGE_READ);
  EXPECT_EQ(job.artifacts_size(), 0);
}

TEST_F(Rpc, AnExceptionOfTheMesherFailsThatJobOnly) {
  start();
  mesher_.on_generate = [] { throw std::bad_alloc(); };
  EXPECT_EQ(wait_final(create(tetrahedron_job()).job_id()).error().reason(), "MEMORY_BUDGET_EXCEEDED");
  mesher_.on_generate = [] { throw std::logic_error("oops"); };
  EXPECT_EQ(wait_final(create(tetrahedron_job()).job_id()).error().code(), 13);
  mesher_.on_generate = [] {};
  EXPECT_EQ(wait_final(create(tetrahedron_job()).job_id()).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(Rpc, TheSameRequestIdGivesTheSameJob) {
  start();
  v1::CreateJobRequest request = tetrahedron_job();
  request.set_request_id("once");
  const std::string id = create(request).job_id();
  EXPECT_EQ(create(request).job_id(), id);
  request.set_display_name("other");
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  const grpc::Status status = job_stub_->CreateJob(&context, request, &response);
  EXPECT_EQ(status.error_code(), StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(reason_of(status), "REQUEST_ID_REUSED");
}

TEST_F(Rpc, JobsBeyondTheSlotsWaitAndBeyondTheQueueAreRefusedWithRetry) {
  TestOptions options;
  options.desk.queue_capacity = 1;
  start(options);
  mesher_.hold();
  const std::string running = create(tetrahedron_job()).job_id();
  const std::string waiting = create(tetrahedron_job()).job_id();
  EXPECT_EQ(get(waiting).state(), v1::JOB_STATE_QUEUED);
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  const grpc::Status status = job_stub_->CreateJob(&context, tetrahedron_job(), &response);
  EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(reason_of(status), "QUEUE_FULL");
  EXPECT_GT(retry_of(status), 0);
  mesher_.release();
  EXPECT_EQ(wait_final(running).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(wait_final(waiting).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(Rpc, CancelEndsRunningAndWaitingJobsWithinASecond) {
  start();
  mesher_.hold();
  const std::string running = create(tetrahedron_job()).job_id();
  const std::string waiting = create(tetrahedron_job()).job_id();
  while (get(running).state() != v1::JOB_STATE_RUNNING) std::this_thread::sleep_for(1ms);
  const auto began = std::chrono::steady_clock::now();
  for (const std::string& id : {waiting, running}) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_job_id(id);
    v1::CancelJobResponse response;
    EXPECT_TRUE(job_stub_->CancelJob(&context, request, &response).ok());
  }
  for (const std::string& id : {waiting, running}) {
    const v1::Job job = wait_final(id);
    EXPECT_EQ(job.state(), v1::JOB_STATE_CANCELLED);
    EXPECT_EQ(job.error().reason(), "CANCELLED");
  }
  EXPECT_LT(std::chrono::steady_clock::now() - began, 1s);
}

TEST_F(Rpc, AFinishedJobIsNotChangedByCancel) {
  start();
  const std::string id = create(tetrahedron_job()).job_id();
  wait_final(id);
  grpc::ClientContext context;
  v1::CancelJobRequest request;
  request.set_job_id(id);
  v1::CancelJobResponse response;
  EXPECT_TRUE(job_stub_->CancelJob(&context, request, &response).ok());
  EXPECT_EQ(response.job().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(Rpc, ATimeLimitFailsTheJob) {
  start();
  mesher_.hold();
  v1::CreateJobRequest request = tetrahedron_job();
  request.set_time_limit_seconds(0.2);
  const v1::Job job = wait_final(create(request).job_id());
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().reason(), "TIME_BUDGET_EXCEEDED");
}

TEST_F(Rpc, UnknownJobsAreNotFoundByEveryCall) {
  start();
  for (const std::string& id : {random_id(), std::string("../x"), std::string()}) {
    const auto code = [](const grpc::Status& status) { return status.error_code(); };
    grpc::ClientContext c1, c2, c3, c4;
    v1::GetJobRequest get_request;
    get_request.set_job_id(id);
    v1::GetJobResponse got;
    EXPECT_EQ(code(job_stub_->GetJob(&c1, get_request, &got)), StatusCode::NOT_FOUND);
    v1::CancelJobRequest cancel_request;
    cancel_request.set_job_id(id);
    v1::CancelJobResponse cancelled;
    EXPECT_EQ(code(job_stub_->CancelJob(&c2, cancel_request, &cancelled)), StatusCode::NOT_FOUND);
    v1::DeleteJobRequest delete_request;
    delete_request.set_job_id(id);
    v1::DeleteJobResponse deleted;
    EXPECT_EQ(code(job_stub_->DeleteJob(&c3, delete_request, &deleted)), StatusCode::NOT_FOUND);
    v1::WatchJobRequest watch_request;
    watch_request.set_job_id(id);
    EXPECT_EQ(code(job_stub_->WatchJob(&c4, watch_request)->Finish()), StatusCode::NOT_FOUND);
  }
}

TEST_F(Rpc, DeleteForgetsTheJobAndItsMesh) {
  start();
  const v1::Job job = wait_final(create(tetrahedron_job()).job_id());
  grpc::ClientContext context;
  v1::DeleteJobRequest request;
  request.set_job_id(job.job_id());
  v1::DeleteJobResponse response;
  EXPECT_TRUE(job_stub_->DeleteJob(&context, request, &response).ok());
  EXPECT_EQ(get(job.job_id()).job_id(), "");
  std::string bytes;
  EXPECT_EQ(read(job.artifacts(0).blob().blob_id(), 0, bytes).error_code(), StatusCode::NOT_FOUND);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ + "/blobs"));
}

TEST_F(Rpc, DeleteOfARunningJobNeedsToBeMeant) {
  start();
  mesher_.hold();
  v1::DeleteJobRequest request;
  request.set_job_id(create(tetrahedron_job()).job_id());
  v1::DeleteJobResponse response;
  grpc::ClientContext c1, c2;
  EXPECT_EQ(job_stub_->DeleteJob(&c1, request, &response).error_code(), StatusCode::FAILED_PRECONDITION);
  request.set_cancel_if_running(true);
  EXPECT_TRUE(job_stub_->DeleteJob(&c2, request, &response).ok());
  for (int i = 0; i < 200 && !get(request.job_id()).job_id().empty(); ++i) std::this_thread::sleep_for(5ms);
  EXPECT_EQ(get(request.job_id()).job_id(), "");
}

TEST_F(Rpc, ListPagesAndFilters) {
  start();
  for (int i = 0; i < 3; ++i) wait_final(create(tetrahedron_job()).job_id());
  v1::ListJobsRequest request;
  request.set_page_size(2);
  v1::ListJobsResponse response;
  grpc::ClientContext c1, c2, c3, c4;
  EXPECT_TRUE(job_stub_->ListJobs(&c1, request, &response).ok());
  EXPECT_EQ(response.jobs_size(), 2);
  request.set_page_token(response.next_page_token());
  v1::ListJobsResponse second;
  EXPECT_TRUE(job_stub_->ListJobs(&c2, request, &second).ok());
  EXPECT_EQ(second.jobs_size(), 1);
  EXPECT_EQ(second.next_page_token(), "");
  request.set_page_token("x");
  EXPECT_EQ(job_stub_->ListJobs(&c3, request, &second).error_code(), StatusCode::INVALID_ARGUMENT);
  request.clear_page_token();
  request.add_states(v1::JOB_STATE_FAILED);
  EXPECT_TRUE(job_stub_->ListJobs(&c4, request, &second).ok());
  EXPECT_EQ(second.jobs_size(), 0);
}

TEST_F(Rpc, ValidateTellsFindingsPatchesAndEstimateAndStoresNothing) {
  start();
  v1::ValidateJobRequest request;
  *request.mutable_surface() = tetrahedron_job().surface();
  request.set_spec_json(R"({"sizing":{"max_size":0.5}})");
  v1::ValidateJobResponse response;
  grpc::ClientContext c1, c2, c3;
  ASSERT_TRUE(job_stub_->ValidateJob(&c1, request, &response).ok());
  EXPECT_TRUE(response.acceptable());
  EXPECT_EQ(response.patches(0).name(), "surface");
  EXPECT_EQ(response.estimate().triangles(), 4);
  EXPECT_EQ(response.effective_spec().sizing().max_size(), 0.5);
  EXPECT_EQ(response.effective_spec().features().ridge_angle_deg(), 40);
  request.set_spec_json(R"({"sizing":{"max_size":"big"}})");
  ASSERT_TRUE(job_stub_->ValidateJob(&c2, request, &response).ok());
  EXPECT_FALSE(response.acceptable());
  EXPECT_EQ(response.findings(0).field(), "sizing.max_size");
  request.clear_specification();
  request.mutable_surface()->set_data("garbage");
  ASSERT_TRUE(job_stub_->ValidateJob(&c3, request, &response).ok());
  EXPECT_FALSE(response.acceptable());
  EXPECT_EQ(response.findings(0).reason(), "FILE_MALFORMED");
  EXPECT_TRUE(std::filesystem::is_empty(folder_ + "/blobs"));
}

TEST_F(Rpc, CapabilitiesAndStatusDescribeTheServer) {
  TestOptions options;
  options.slots = 3;
  options.desk.queue_capacity = 7;
  start(options);
  v1::GetCapabilitiesResponse can;
  v1::GetServerStatusResponse now;
  grpc::ClientContext c1, c2;
  ASSERT_TRUE(system_stub_->GetCapabilities(&c1, {}, &can).ok());
  EXPECT_EQ(can.version(), "test");
  EXPECT_EQ(can.limits().slots(), 3);
  EXPECT_EQ(can.limits().queue_capacity(), 7);
  EXPECT_EQ(can.stages_size(), kStageCount);
  EXPECT_EQ(can.output_formats_size(), 7);
  EXPECT_FALSE(can.draining());
  ASSERT_TRUE(system_stub_->GetServerStatus(&c2, {}, &now).ok());
  EXPECT_GT(now.resident_memory_bytes(), 1 << 20);
}

TEST_F(Rpc, ADrainingServerRefusesNewJobsAndFinishesTheRunning) {
  start();
  mesher_.hold();
  const std::string id = create(tetrahedron_job()).job_id();
  desk_->drain();
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  const grpc::Status status = job_stub_->CreateJob(&context, tetrahedron_job(), &response);
  EXPECT_EQ(status.error_code(), StatusCode::UNAVAILABLE);
  EXPECT_EQ(reason_of(status), "DRAINING");
  EXPECT_GT(retry_of(status), 0);
  EXPECT_FALSE(desk_->wait_idle(50ms));
  mesher_.release();
  EXPECT_TRUE(desk_->wait_idle(2s));
  EXPECT_EQ(get(id).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(Addresses, BeyondLoopbackNeedTlsOrInsecure) {
  EXPECT_TRUE(is_local("127.0.0.1:1"));
  EXPECT_TRUE(is_local("unix:/tmp/x"));
  EXPECT_TRUE(is_local("[::1]:1"));
  EXPECT_TRUE(is_local("localhost:1"));
  EXPECT_FALSE(is_local("0.0.0.0:1"));
  EXPECT_FALSE(is_local("[::]:1"));
  EXPECT_FALSE(is_local("example.com:1"));
}

}  // namespace
}  // namespace strata::server
