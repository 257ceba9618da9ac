// Every call, through a real server in this process.
#include <filesystem>
#include <thread>

#include "core/base/stage.h"
#include "proto/wire/frame.h"
#include "proto/wire/sha256.h"
#include "server/ids.h"
#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;
using Rpc = ServerFixture;

std::vector<v1::WatchJobResponse> drain(grpc::ClientReader<v1::WatchJobResponse>& reader) {
  std::vector<v1::WatchJobResponse> events;
  for (v1::WatchJobResponse event; reader.Read(&event);) events.push_back(event);
  return events;
}

// ---- jobs

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

// ---- watching

TEST_F(Rpc, WatchTellsAllFromSnapshotToDone) {
  start();
  mesher_.hold();
  v1::WatchJobRequest request;
  request.set_job_id(create(tetrahedron_job()).job_id());
  grpc::ClientContext context;
  const auto reader = job_stub_->WatchJob(&context, request);
  std::thread later([&] {
    std::this_thread::sleep_for(300ms);
    mesher_.release();
  });
  const auto events = drain(*reader);
  later.join();
  EXPECT_TRUE(reader->Finish().ok());
  ASSERT_GE(events.size(), 5u);
  EXPECT_TRUE(events.front().has_snapshot());
  EXPECT_TRUE(events.back().has_done());
  EXPECT_EQ(events.back().done().state(), v1::JOB_STATE_SUCCEEDED);
  std::int64_t last = 0;
  double fraction = 0;
  int progress = 0, ended = 0, quality = 0, adjustments = 0;
  for (const v1::WatchJobResponse& event : events) {
    if (event.sequence() > 0 && !event.has_done()) {
      EXPECT_GT(event.sequence(), last);
      last = event.sequence();
    }
    if (event.has_progress()) {
      EXPECT_GE(event.progress().fraction(), fraction);
      fraction = event.progress().fraction();
      ++progress;
    }
    ended += event.has_stage_ended();
    quality += event.has_quality();
    adjustments += event.has_adjustment();
  }
  EXPECT_GE(progress, 2);
  EXPECT_EQ(ended, events.back().done().stages_size());
  EXPECT_EQ(quality, 1);
  EXPECT_EQ(adjustments, 1);
}

TEST_F(Rpc, WatchResumesAfterASequenceEvenWhenTheJobHasEnded) {
  start();
  v1::WatchJobRequest request;
  request.set_job_id(create(tetrahedron_job()).job_id());
  wait_final(request.job_id());
  grpc::ClientContext c1, c2;
  const auto all = drain(*job_stub_->WatchJob(&c1, request));
  const std::size_t middle = all.size() / 2;
  request.set_after_sequence(all[middle].sequence());
  const auto rest = drain(*job_stub_->WatchJob(&c2, request));
  ASSERT_EQ(rest.size(), all.size() - middle);  // a snapshot in place of the events before
  for (std::size_t i = 1; i < rest.size(); ++i) EXPECT_EQ(rest[i].sequence(), all[middle + i].sequence());
}

TEST_F(Rpc, WatchSendsHeartbeatsWhileNothingHappens) {
  start();
  mesher_.hold();
  create(tetrahedron_job());
  v1::WatchJobRequest request;
  request.set_job_id(create(tetrahedron_job()).job_id());  // waits behind the first
  request.set_heartbeat_seconds(1);
  grpc::ClientContext context;
  const auto reader = job_stub_->WatchJob(&context, request);
  v1::WatchJobResponse event;
  bool heard = false;
  while (!heard && reader->Read(&event)) heard = event.has_heartbeat();
  EXPECT_TRUE(heard);
  context.TryCancel();
}

TEST_F(Rpc, AWatcherThatLeavesDisturbsNobody) {
  start();
  mesher_.hold();
  v1::WatchJobRequest request;
  request.set_job_id(create(tetrahedron_job()).job_id());
  for (int i = 0; i < 20; ++i) {
    grpc::ClientContext context;
    const auto reader = job_stub_->WatchJob(&context, request);
    v1::WatchJobResponse event;
    EXPECT_TRUE(reader->Read(&event));
    context.TryCancel();
  }
  mesher_.release();
  EXPECT_EQ(wait_final(request.job_id()).state(), v1::JOB_STATE_SUCCEEDED);
}

// ---- blobs

TEST_F(Rpc, AnUploadedSurfaceIsMeshedAndKnownByItsDigest) {
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

TEST_F(Rpc, AnUploadResumesAfterADamagedFrame) {
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

TEST_F(Rpc, UploadsThatLieAreRefused) {
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
  EXPECT_EQ(code_of(std::int64_t{1} << 60, ""), StatusCode::RESOURCE_EXHAUSTED);

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

TEST_F(Rpc, FramesThatCannotBeReadAreRefusedAndWhatCameBeforeStays) {
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

TEST_F(Rpc, PackedDownloadsResumeAtAnyByte) {
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

TEST_F(Rpc, DownloadsResumeAtAnyByte) {
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

// ---- one shot

TEST_F(Rpc, GenerateMeshDoesAllInOneCall) {
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

TEST_F(Rpc, GenerateMeshEndsWithTheErrorOfTheJob) {
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

TEST_F(Rpc, GenerateMeshCancelsTheJobWhenTheClientLeaves) {
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

TEST_F(Rpc, GenerateMeshRefusesFramesOutOfOrderOrWithoutOpen) {
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

// ---- system

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
