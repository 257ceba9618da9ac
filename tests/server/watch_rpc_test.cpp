// WatchJob, through a real server in this process.
#include <thread>

#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;
using WatchRpc = ServerFixture;

std::vector<v1::WatchJobResponse> drain(grpc::ClientReader<v1::WatchJobResponse>& reader) {
  std::vector<v1::WatchJobResponse> events;
  for (v1::WatchJobResponse event; reader.Read(&event);) events.push_back(event);
  return events;
}

TEST_F(WatchRpc, WatchTellsAllFromSnapshotToDone) {
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

TEST_F(WatchRpc, WatchResumesAfterASequenceEvenWhenTheJobHasEnded) {
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

TEST_F(WatchRpc, WatchSendsHeartbeatsWhileNothingHappens) {
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

TEST_F(WatchRpc, AWatcherThatLeavesDisturbsNobody) {
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

TEST_F(WatchRpc, WatchesBeyondTheLimitAreToldWhenToComeBack) {
  TestOptions options;
  options.desk.max_watchers = 2;
  start(options);
  mesher_.hold();
  v1::WatchJobRequest request;
  request.set_job_id(create(tetrahedron_job()).job_id());
  v1::WatchJobResponse event;
  grpc::ClientContext first, second, third;
  const auto one = job_stub_->WatchJob(&first, request);
  const auto two = job_stub_->WatchJob(&second, request);
  ASSERT_TRUE(one->Read(&event) && two->Read(&event));
  const grpc::Status refused = job_stub_->WatchJob(&third, request)->Finish();
  EXPECT_EQ(refused.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(reason_of(refused), "TOO_MANY_WATCHES");
  EXPECT_GT(retry_of(refused), 0);

  first.TryCancel();
  bool watched = false;
  for (int i = 0; i < 100 && !watched; ++i, std::this_thread::sleep_for(50ms)) {
    grpc::ClientContext again;
    watched = job_stub_->WatchJob(&again, request)->Read(&event);
    again.TryCancel();
  }
  EXPECT_TRUE(watched);
  mesher_.release();
}

}  // namespace
}  // namespace strata::server
