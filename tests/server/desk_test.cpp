// What the desk remembers, forgets and survives.
#include <google/protobuf/util/time_util.h>

#include <filesystem>
#include <limits>
#include <thread>
#include <vector>

#include "core/base/context.h"
#include "server/ids.h"
#include "server/refusal.h"
#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;

class Desk : public ServerFixture {
 protected:
  static bool within(std::chrono::seconds limit, const std::function<bool()>& holds) {
    for (const auto until = std::chrono::steady_clock::now() + limit; std::chrono::steady_clock::now() < until;
         std::this_thread::sleep_for(10ms))
      if (holds()) return true;
    return holds();
  }
  [[nodiscard]] bool exists(const std::string& id) const { return jobs_->find(id).has_value(); }
};

TEST_F(Desk, ForgetsJobsAndResultsAfterTheirTime) {
  std::atomic<std::int64_t> now = 1'000'000;
  TestOptions options;
  options.desk.result_ttl_seconds = 100;
  options.desk.wall_clock = [&] { return now.load(); };
  start(options);
  v1::CreateJobRequest brief = tetrahedron_job();
  brief.set_result_ttl_seconds(10);
  v1::CreateJobRequest greedy = tetrahedron_job();
  greedy.set_result_ttl_seconds(1e9);
  const v1::Job first = wait_final(create(brief).job_id());
  const v1::Job second = wait_final(create(greedy).job_id());
  EXPECT_EQ(first.expire_time().seconds(), now + 10);
  EXPECT_EQ(second.expire_time().seconds(), now + 100) << "no longer than the server gives";
  now += 50;
  EXPECT_TRUE(within(12s, [&] { return !exists(first.job_id()); }));
  EXPECT_TRUE(exists(second.job_id()));
  EXPECT_FALSE(blobs_->find(first.artifacts(0).blob().blob_id()));
  EXPECT_TRUE(blobs_->find(second.artifacts(0).blob().blob_id()));
}

TEST_F(Desk, ATimeToLiveWithoutEndIsALongOne) {
  start();  // the server has no limit of its own
  for (const double asked : {1e300, std::numeric_limits<double>::infinity()}) {
    v1::CreateJobRequest request = tetrahedron_job();
    request.set_result_ttl_seconds(asked);
    const v1::Job job = wait_final(create(request).job_id());
    EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
    EXPECT_GT(job.expire_time().seconds() - job.end_time().seconds(), 50LL * 365 * 86400);
    EXPECT_LT(job.expire_time().seconds(), 253'402'300'799) << "the last second that a timestamp can hold";
  }
}

TEST_F(Desk, ForgetsNothingWhenTheClockJumps) {
  std::atomic<std::int64_t> now = 1'000'000;
  TestOptions options;
  options.desk.result_ttl_seconds = 100;
  options.desk.wall_clock = [&] { return now.load(); };
  start(options);
  const v1::Job job = wait_final(create(tetrahedron_job()).job_id());
  std::this_thread::sleep_for(200ms);  // the sweep has seen the clock as it was
  now += 10LL * 365 * 86400;
  std::this_thread::sleep_for(6s);
  EXPECT_TRUE(exists(job.job_id()));
}

TEST_F(Desk, AFullDiskRefusesNewJobsAndSaysWhy) {
  TestOptions options;
  options.desk.disk_reserve_bytes = std::int64_t{1} << 60;
  start(options);
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  const grpc::Status status = job_stub_->CreateJob(&context, tetrahedron_job(), &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(reason_of(status), "STORAGE_FULL");
  EXPECT_GT(retry_of(status), 0);
}

TEST_F(Desk, AJobThatWouldNeedMoreMemoryThanThereIsFailsBeforeItIsMeshed) {
  start();
  mesher_.needed_memory = std::int64_t{1} << 40;
  const v1::Job job = wait_final(create(tetrahedron_job()).job_id());
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().reason(), "MEMORY_BUDGET_EXCEEDED");
  EXPECT_EQ(job.error().code(), 8);
}

// Admission: what must wait is priced first, and what could never run does not wait.
class Priced : public Desk {
 protected:
  void SetUp() override {
    TestOptions options;
    options.desk.admission.memory_budget_bytes = 1000;
    start(options);
    mesher_.hold();
    mesher_.needed_memory = 500;
    create(tetrahedron_job());
    ASSERT_TRUE(within(5s, [&] { return desk_->load().running == 1; }));
  }
  grpc::Status submit(const v1::CreateJobRequest& request, v1::Job* job = nullptr) {
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    const grpc::Status status = job_stub_->CreateJob(&context, request, &response);
    if (job != nullptr) *job = response.job();
    return status;
  }
  // Costs nothing that is known yet.
  static v1::CreateJobRequest other_job(double size) {
    v1::CreateJobRequest request = tetrahedron_job();
    request.mutable_spec()->mutable_sizing()->set_max_size(size);
    return request;
  }
};

TEST_F(Priced, AWaitingJobCarriesItsEstimate) {
  v1::Job job;
  ASSERT_TRUE(submit(other_job(0.3), &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(job.estimate().memory_bytes(), 500);
  EXPECT_EQ(job.estimate().triangles(), 4);
}

TEST_F(Priced, AJobThatNoWorkerCouldEverRunIsRefusedWithTheFigures) {
  mesher_.needed_memory = std::int64_t{3} << 20;
  const grpc::Status status = submit(other_job(0.3));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(reason_of(status), "MEMORY_BUDGET_EXCEEDED");
  EXPECT_NE(status.error_message().find("3 MiB"), std::string::npos) << status.error_message();
  EXPECT_EQ(retry_of(status), 0) << "coming back does not help";
  EXPECT_EQ(desk_->load().queued, 0);
  EXPECT_EQ(submit(other_job(0.3)).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

TEST_F(Priced, ValidateRefusesTheSame) {
  mesher_.needed_memory = std::int64_t{3} << 20;
  v1::ValidateJobRequest request;
  *request.mutable_surface() = tetrahedron_job().surface();
  v1::ValidateJobResponse response;
  grpc::ClientContext context;
  ASSERT_TRUE(job_stub_->ValidateJob(&context, request, &response).ok());
  EXPECT_FALSE(response.acceptable());
  ASSERT_EQ(response.findings_size(), 1);
  EXPECT_EQ(response.findings(0).reason(), "MEMORY_BUDGET_EXCEEDED");
  EXPECT_EQ(response.findings(0).values().at("budget_bytes"), 1000);
}

TEST_F(Priced, WhatARunFoundOutIsRememberedAndALongQueueIsNotPriced) {
  v1::Job job;
  ASSERT_TRUE(submit(tetrahedron_job(), &job).ok());
  EXPECT_TRUE(job.has_estimate()) << "the first of its kind told while it ran";
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(submit(other_job(0.1 + 0.01 * i), &job).ok());
  EXPECT_FALSE(job.has_estimate());
}

TEST_F(Priced, PricingEndsWhenItsCallerLeavesAndTheJobIsTaken) {
  mesher_.before_estimate = [](const Context& context) {
    for (;; std::this_thread::sleep_for(1ms)) context.checkpoint();
  };
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + 300ms);
  v1::CreateJobResponse response;
  EXPECT_EQ(job_stub_->CreateJob(&context, other_job(0.3), &response).error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_TRUE(within(5s, [&] { return desk_->load().queued == 1; }));
}

TEST_F(Priced, OneCallIsPricedToo) {
  mesher_.needed_memory = std::int64_t{3} << 20;
  grpc::ClientContext context;
  const auto stream = job_stub_->GenerateMesh(&context);
  v1::GenerateMeshRequest open;
  *open.mutable_open()->mutable_job() = other_job(0.4);
  stream->Write(open);
  stream->WritesDone();
  v1::GenerateMeshResponse response;
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_EQ(reason_of(stream->Finish()), "MEMORY_BUDGET_EXCEEDED");
}

TEST_F(Desk, TheServersLimitOfCellsIsInEverySpecification) {
  TestOptions options;
  options.desk.admission.max_cells = 1000;
  start(options);
  v1::CreateJobRequest request = tetrahedron_job();
  EXPECT_EQ(create(request).spec().sizing().max_cells(), 1000);
  request.mutable_spec()->mutable_sizing()->set_max_cells(50);
  EXPECT_EQ(create(request).spec().sizing().max_cells(), 50);
  request.mutable_spec()->mutable_sizing()->set_max_cells(5000);
  EXPECT_EQ(create(request).spec().sizing().max_cells(), 1000);
}

TEST_F(Desk, TheSameInlineSurfaceIsStoredOnceAndStaysWhileAJobUsesIt) {
  start();
  const v1::Job first = wait_final(create(tetrahedron_job()).job_id());
  mesher_.hold();
  const std::string second = create(tetrahedron_job()).job_id();
  std::string surface;
  EXPECT_EQ(jobs_->find(second)->request.surface().blob_id(), surface = jobs_->find(first.job_id())->request.surface().blob_id());
  v1::DeleteJobRequest request;
  request.set_job_id(first.job_id());
  desk_->remove({}, request);
  EXPECT_TRUE(blobs_->find(surface));
  mesher_.release();
  EXPECT_EQ(wait_final(second).state(), v1::JOB_STATE_SUCCEEDED);
  request.set_job_id(second);
  desk_->remove({}, request);
  EXPECT_FALSE(blobs_->find(surface));
}

// A surface that goes with its last job, while the next one with the same comes.
TEST_F(Desk, AnAcceptedJobNeverLosesItsSurface) {
  TestOptions options;
  options.slots = 2;
  start(options);
  std::atomic<bool> enough = false;
  std::atomic<int> lost = 0, made = 0;
  std::vector<std::thread> clients;
  for (int c = 0; c < 4; ++c)
    clients.emplace_back([&] {
      while (!enough) {
        const std::string id = desk_->create({}, tetrahedron_job()).job.job_id();
        for (v1::Job job; !is_final(job.state()); std::this_thread::yield()) job = desk_->get({}, id);
        if (desk_->get({}, id).state() != v1::JOB_STATE_SUCCEEDED) ++lost;
        v1::DeleteJobRequest request;
        request.set_job_id(id);
        desk_->remove({}, request);
        ++made;
      }
    });
  std::this_thread::sleep_for(1s);
  enough = true;
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(lost, 0);
  EXPECT_GT(made, 10);
}

TEST_F(Desk, UrgentJobsOvertake) {
  TestOptions options;
  start(options);
  mesher_.hold();
  const std::string running = create(tetrahedron_job()).job_id();
  ASSERT_TRUE(within(5s, [&] { return desk_->load().running == 1; }));
  const std::string later = create(tetrahedron_job()).job_id();
  v1::CreateJobRequest urgent = tetrahedron_job();
  urgent.set_priority(5);
  const std::string first = create(urgent).job_id();
  EXPECT_EQ(get(first).queue_position(), 0);
  EXPECT_EQ(get(later).queue_position(), 1);
  mesher_.release();
  const auto started = [&](const std::string& id) {
    return google::protobuf::util::TimeUtil::TimestampToNanoseconds(wait_final(id).start_time());
  };
  EXPECT_LT(started(first), started(later));
}

// The same store under a new desk, as after a crash.
TEST_F(Desk, UnfinishedJobsGoOnUnderANewDeskWithGrowingSequences) {
  start();
  mesher_.hold();
  const std::string id = create(tetrahedron_job()).job_id();
  const std::string waiting = create(tetrahedron_job()).job_id();
  ASSERT_TRUE(within(5s, [&] { return get(id).state() == v1::JOB_STATE_RUNNING; }));
  std::this_thread::sleep_for(1500ms);  // until the start is saved
  const std::int64_t before = get(id).last_sequence();
  server_.reset();
  desk_.reset();  // interrupts: the job stays RUNNING in the store
  ASSERT_EQ(jobs_->find(id)->job.state(), v1::JOB_STATE_RUNNING);
  mesher_.release();
  desk_ = std::make_unique<JobDesk>(*jobs_, *blobs_, *runner_, *checker_, mesher_.door(), DeskOptions{});
  EXPECT_TRUE(within(10s, [&] { return desk_->get(Caller{}, id).state() == v1::JOB_STATE_SUCCEEDED; }));
  EXPECT_TRUE(within(10s, [&] { return desk_->get(Caller{}, waiting).state() == v1::JOB_STATE_SUCCEEDED; }));
  EXPECT_GT(desk_->get(Caller{}, id).last_sequence(), before);
  EXPECT_EQ(desk_->get(Caller{}, id).attempt(), 2);
}

TEST_F(Desk, AJobThatEndsTheServerEachTimeIsNotStartedForEver) {
  start();
  StoredJob poison;
  poison.job.set_job_id(random_id());
  poison.job.set_state(v1::JOB_STATE_RUNNING);
  poison.job.set_attempt(10);
  ASSERT_TRUE(jobs_->insert(poison, {}));
  server_.reset();
  desk_.reset();
  DeskOptions options;
  options.max_starts = 10;
  desk_ = std::make_unique<JobDesk>(*jobs_, *blobs_, *runner_, *checker_, mesher_.door(), options);
  const v1::Job job = desk_->get(Caller{}, poison.job.job_id());
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().reason(), "POISON_JOB");
}

// What the store says at the moment of the answer is what a crash would leave.
TEST_F(Desk, ACancelOrARemovalOfARunningJobIsStoredWhenItIsAnswered) {
  start();
  for (const bool remove : {false, true}) {
    mesher_.hold();
    std::atomic<bool> go_on = false;
    mesher_.on_generate = [&] {
      while (!go_on) std::this_thread::sleep_for(1ms);
    };
    const std::string id = create(tetrahedron_job()).job_id();
    ASSERT_TRUE(within(5s, [&] { return desk_->load().running == 1; }));
    v1::DeleteJobRequest request;
    request.set_job_id(id);
    request.set_cancel_if_running(true);
    if (remove) desk_->remove({}, request);
    else desk_->cancel({}, id);
    const v1::Job stored = jobs_->find(id)->job;
    go_on = true;
    EXPECT_TRUE(stored.cancel_requested());
    EXPECT_EQ(stored.has_expire_time(), remove);
    if (remove) EXPECT_TRUE(within(5s, [&] { return !exists(id); }));
    else EXPECT_EQ(wait_final(id).state(), v1::JOB_STATE_CANCELLED);
    mesher_.on_generate = [] {};
    ASSERT_TRUE(within(5s, [&] { return desk_->load().running == 0; }));
  }
}

TEST_F(Desk, WhatWasCancelledOrRemovedBeforeACrashDoesNotRunAfterIt) {
  start();
  StoredJob cancelled, removed;
  for (StoredJob* one : {&cancelled, &removed}) {
    one->job.set_job_id(random_id());
    one->job.set_state(v1::JOB_STATE_RUNNING);
    one->job.set_attempt(1);
    one->job.set_cancel_requested(true);
  }
  removed.job.mutable_expire_time()->set_seconds(1);
  ASSERT_TRUE(jobs_->insert(cancelled, {}));
  ASSERT_TRUE(jobs_->insert(removed, {}));
  server_.reset();
  desk_.reset();
  std::atomic<int> told = 0;
  DeskOptions options;
  options.result_ttl_seconds = 1000;
  options.on_unrun = [&](const v1::Job& job) { told += job.state() == v1::JOB_STATE_CANCELLED ? 1 : 0; };
  desk_ = std::make_unique<JobDesk>(*jobs_, *blobs_, *runner_, *checker_, mesher_.door(), options);
  EXPECT_EQ(told, 2);
  EXPECT_EQ(desk_->get(Caller{}, cancelled.job.job_id()).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_TRUE(within(12s, [&] { return !exists(removed.job.job_id()); }));
  EXPECT_TRUE(exists(cancelled.job.job_id()));
}

TEST_F(Desk, AJobThatIsCancelledInTheQueueIsToldOfToo) {
  TestOptions options;
  std::atomic<int> told = 0;
  options.desk.on_unrun = [&](const v1::Job& job) { told += job.state() == v1::JOB_STATE_CANCELLED ? 1 : 0; };
  start(options);
  mesher_.hold();
  const std::string running = create(tetrahedron_job()).job_id(), waiting = create(tetrahedron_job()).job_id();
  desk_->cancel({}, waiting);
  EXPECT_EQ(told, 1);
  desk_->cancel({}, running);
  EXPECT_EQ(wait_final(running).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(told, 1) << "its runner told of the other";
}

// A store that cannot forget, for a while.
class StubbornStore final : public JobStore {
 public:
  explicit StubbornStore(JobStore& store) : store_(store) {}
  std::atomic<bool> keeps = true;

  bool insert(const StoredJob& stored, const v1::WatchJobResponse& first_event) override { return store_.insert(stored, first_event); }
  std::optional<StoredJob> find(const std::string& id) const override { return store_.find(id); }
  std::optional<StoredJob> find_request(const std::string& tenant, const std::string& id) const override {
    return store_.find_request(tenant, id);
  }
  void update(const v1::Job& job, const std::vector<v1::WatchJobResponse>& events) override { store_.update(job, events); }
  std::vector<v1::WatchJobResponse> events(const std::string& id, std::int64_t after) const override { return store_.events(id, after); }
  JobPage list(const JobQuery& query) const override { return store_.list(query); }
  void remove(const std::string& id) override {
    if (keeps) throw Refusal(Refused::Unavailable, "STORAGE_FAILED", "the store is held by somebody else");
    store_.remove(id);
  }
  std::vector<StoredJob> unfinished() const override { return store_.unfinished(); }
  std::int64_t count() const override { return store_.count(); }
  std::vector<std::string> expired(std::int64_t now, int at_most) const override { return store_.expired(now, at_most); }
  bool uses(const std::string& blob_id) const override { return store_.uses(blob_id); }

 private:
  JobStore& store_;
};

TEST_F(Desk, ARemovalThatTheStoreDoesNotTakeIsMadeUpForLater) {
  start();
  server_.reset();
  desk_.reset();
  StubbornStore store(*jobs_);
  desk_ = std::make_unique<JobDesk>(store, *blobs_, *runner_, *checker_, mesher_.door(), DeskOptions{});
  mesher_.hold();
  const std::string id = desk_->create({}, tetrahedron_job()).job.job_id();
  v1::DeleteJobRequest request;
  request.set_job_id(id);
  request.set_cancel_if_running(true);
  desk_->remove({}, request);
  ASSERT_TRUE(within(5s, [&] { return desk_->load().running == 0; }));
  std::this_thread::sleep_for(300ms);  // the desk tries, and lives
  EXPECT_TRUE(exists(id));
  store.keeps = false;
  EXPECT_TRUE(within(12s, [&] { return !exists(id); }));
  desk_.reset();
}

}  // namespace
}  // namespace strata::server
