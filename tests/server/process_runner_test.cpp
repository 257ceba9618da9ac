// Jobs in processes of their own: whatever happens to one of them, the server and the other jobs go on.
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/process_fixture.h"

namespace strata::server {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
using ProcessRunner = ProcessFixture;

int attempts(const std::vector<v1::WatchJobResponse>& events) {
  int most = 1;
  for (const auto& event : events) most = std::max(most, event.state_changed().attempt());
  return most;
}

TEST_F(ProcessRunner, AJobSucceedsAndItsResultsAreBlobsOfTheServer) {
  const Run run = wait(start("fine"));
  ASSERT_EQ(run.job.state(), v1::JOB_STATE_SUCCEEDED) << run.job.error().message();
  ASSERT_EQ(run.job.artifacts_size(), 1);
  const auto blob = blobs_->find(run.job.artifacts(0).blob().blob_id());
  ASSERT_TRUE(blob);
  EXPECT_EQ(read_all(*blobs_, *blob).size(), static_cast<std::size_t>(blob->size));
  EXPECT_GT(run.job.usage().peak_memory_bytes(), 1 << 20);
  EXPECT_EQ(attempts(run.events), 1);
}

TEST_F(ProcessRunner, ACrashIsTriedAgainOnceAndToldWithStageAndBacktrace) {
  for (const auto& [fault, name] :
       {std::pair{"segv", "signal 11"}, {"abort", "signal 6"}, {"killed", "signal 9"}, {"exit", "exit status 3"}}) {
    SCOPED_TRACE(fault);
    const std::string other = start("wait");
    wait_for_progress(other);
    const Run run = wait(start(fault));
    EXPECT_EQ(run.job.state(), v1::JOB_STATE_FAILED);
    EXPECT_EQ(run.job.error().reason(), "WORKER_CRASHED");
    EXPECT_EQ(run.job.error().code(), 13);
    EXPECT_EQ(run.job.error().stage(), v1::STAGE_FIT_TO_SMOOTH);
    EXPECT_NE(run.job.error().message().find(name), std::string::npos) << run.job.error().message();
    EXPECT_EQ(attempts(run.events), 2);
    if (std::string(fault) == "segv" || std::string(fault) == "abort") {
      for (const char* function : {"strata::server::break_down_here", "strata::server::(anonymous namespace)::misbehave"})
        EXPECT_NE(run.job.error().backtrace().find(function), std::string::npos) << run.job.error().backtrace();
    }
    EXPECT_FALSE(runs_[other].ended) << "the job beside it goes on";
    runner_->cancel(other, Stop::Cancelled);
    EXPECT_EQ(wait(other).job.state(), v1::JOB_STATE_CANCELLED);
  }
}

TEST_F(ProcessRunner, WhateverHappensBesideItAJobMakesTheSameMesh) {
  const auto digest_of = [](const Run& run) { return run.job.artifacts_size() == 1 ? run.job.artifacts(0).blob().sha256() : "none"; };
  const std::string alone = digest_of(wait(start("slow")));
  ASSERT_EQ(alone.size(), 32u);
  for (const char* fault : {"segv", "abort", "killed", "exit", "throw", "greedy"}) {
    const std::string beside = start("slow");
    const Run faulty = wait(start(fault));
    EXPECT_EQ(faulty.job.state(), v1::JOB_STATE_FAILED);
    EXPECT_EQ(digest_of(wait(beside)), alone) << fault;
  }
  const std::string beside = start("slow"), looping = start("loop");
  EXPECT_EQ(digest_of(wait(beside)), alone);
  runner_->cancel(looping, Stop::OutOfTime);
  EXPECT_NE(wait(looping).job.state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(ProcessRunner, ASecondTryMaySucceed) {
  const std::string mark = folder_ + "/mark";
  std::ofstream(mark) << "crash once";
  setenv("STRATA_TEST_MARK", mark.c_str(), 1);
  const Run run = wait(start("once"));
  unsetenv("STRATA_TEST_MARK");
  EXPECT_EQ(run.job.state(), v1::JOB_STATE_SUCCEEDED) << run.job.error().message();
  EXPECT_EQ(attempts(run.events), 2);
}

TEST_F(ProcessRunner, AnExceptionIsTheJobsErrorAndNotTriedAgain) {
  const Run run = wait(start("throw"));
  EXPECT_EQ(run.job.error().reason(), "INTERNAL");
  EXPECT_NE(run.job.error().message().find("thrown by the mesher"), std::string::npos);
  EXPECT_EQ(attempts(run.events), 1);
}

TEST_F(ProcessRunner, ALoopThatHeedsNothingIsKilledWithinASecondOfCancel) {
  const std::string id = start("loop");
  wait_for_progress(id);
  const Clock::time_point asked = Clock::now();
  runner_->cancel(id, Stop::Cancelled);
  const Run run = wait(id);
  EXPECT_LT(Clock::now() - asked, 1s);
  EXPECT_EQ(run.job.state(), v1::JOB_STATE_CANCELLED);
}

TEST_F(ProcessRunner, ALoopThatIsOutOfTimeTellsWhereItWas) {
  const std::string id = start("loop");
  wait_for_progress(id);
  runner_->cancel(id, Stop::OutOfTime);
  const Run run = wait(id);
  EXPECT_EQ(run.job.state(), v1::JOB_STATE_FAILED) << "what logs, traces and metrics hear is what the record says";
  EXPECT_EQ(run.job.error().reason(), "TIME_BUDGET_EXCEEDED");
  EXPECT_EQ(run.job.error().stage(), v1::STAGE_FIT_TO_SMOOTH);
  EXPECT_NE(run.job.error().backtrace().find("loop_for_ever"), std::string::npos) << run.job.error().backtrace();
}

#if !defined(__SANITIZE_ADDRESS__)
TEST_F(ProcessRunner, AskingForAHundredGigabytesEndsAtTheLimit) {
  const Run run = wait(start("allocate"));
  EXPECT_EQ(run.job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(run.job.error().reason(), "MEMORY_BUDGET_EXCEEDED");
  EXPECT_EQ(run.job.error().code(), 8);
  EXPECT_EQ(attempts(run.events), 2) << "the second time with all the memory there is";
  EXPECT_LT(run.job.usage().peak_memory_bytes(), memory_.budget());
}
#endif

TEST_F(ProcessRunner, AnEstimateBeyondTheBudgetIsRefusedBeforeTheWork) {
  const Run run = wait(start("greedy"));
  EXPECT_EQ(run.job.error().reason(), "MEMORY_BUDGET_EXCEEDED");
  EXPECT_NE(run.job.error().message().find("2048 MiB"), std::string::npos) << run.job.error().message();
  EXPECT_EQ(attempts(run.events), 1);
}

TEST_F(ProcessRunner, GoingDownEndsTheWorkers) {
  const std::string id = start("loop");
  wait_for_progress(id);
  const Clock::time_point asked = Clock::now();
  runner_.reset();
  EXPECT_LT(Clock::now() - asked, 2s);
  EXPECT_EQ(runs_[id].job.state(), v1::JOB_STATE_CANCELLED);
}

}  // namespace
}  // namespace strata::server
