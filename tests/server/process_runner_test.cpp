// Jobs in processes of their own: whatever happens to one of them, the server and the other jobs go on.
#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/base/diagnostic.h"
#include "server/backtrace.h"
#include "server/bundles.h"
#include "server/checker.h"
#include "server/ids.h"
#include "server/job_runner.h"
#include "server/pipe_messages.h"
#include "server/spec_json.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::int64_t kMemory = std::int64_t{2} << 30;

// Runs jobs of the faulty worker and keeps what they said.
class ProcessRunner : public testing::Test {
 protected:
  struct Run {
    v1::Job job;
    std::vector<v1::WatchJobResponse> events;
    bool ended = false;
  };

  void SetUp() override {
    folder_ = (fs::temp_directory_path() / ("strata-runner-" + random_id())).string();
    fs::create_directories(folder_);
    blobs_ = open_file_blob_store(folder_);
    runner_ = make_process_runner({2, FAULTY_WORKER}, *blobs_, memory_);
  }
  void TearDown() override {
    runner_.reset();
    EXPECT_TRUE(fs::is_empty(folder_ + "/temporary")) << "a worker left something behind";
    EXPECT_EQ(memory_.reserved(), 0);
    fs::remove_all(folder_);
  }

  std::string start(const std::string& fault) {
    const auto writer = blobs_->create("");
    writer->write("solid " + fault +
                  "\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n");
    JobOrder order;
    order.job_id = random_id();
    order.request.mutable_surface()->set_blob_id(writer->publish().id);
    order.request.mutable_surface()->set_format(v1::SURFACE_FORMAT_STL);
    order.request.mutable_spec();
    order.request.add_outputs(v1::OUTPUT_FORMAT_BLOCKS);
    return start(std::move(order));
  }

  std::string start(JobOrder order) {
    const std::string id = order.job_id;
    runner_->start(
        std::move(order),
        [this, id](v1::WatchJobResponse event) {
          const std::lock_guard lock(mutex_);
          runs_[id].events.push_back(std::move(event));
          changed_.notify_all();
        },
        [this, id](v1::Job job) {
          const std::lock_guard lock(mutex_);
          runs_[id].job = std::move(job);
          runs_[id].ended = true;
          changed_.notify_all();
        });
    return id;
  }

  Run wait(const std::string& id) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, 60s, [&] { return runs_[id].ended; }));
    return runs_[id];
  }

  void wait_for_progress(const std::string& id) {
    std::unique_lock lock(mutex_);
    const auto progressed = [](const v1::WatchJobResponse& e) { return e.progress().stage() == v1::STAGE_FIT_TO_SMOOTH; };
    EXPECT_TRUE(changed_.wait_for(lock, 60s, [&] {
      const auto& events = runs_[id].events;
      return std::any_of(events.begin(), events.end(), progressed);
    }));
  }

  std::string folder_;
  MemoryLedger memory_{kMemory};
  std::unique_ptr<BlobStore> blobs_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, Run> runs_;
  std::unique_ptr<JobRunner> runner_;
};

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
  EXPECT_LT(run.job.usage().peak_memory_bytes(), kMemory);
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

// Failures of ours leave what is needed to look into them.
class Bundles : public ProcessRunner {
 protected:
  void SetUp() override {
    ProcessRunner::SetUp();
    inner_ = std::move(runner_);
    runner_ = keep_bundles(*inner_, *blobs_, {folder_ + "/bundles", 2, "test"});
  }
  void TearDown() override {
    runner_.reset();
    inner_.reset();
    ProcessRunner::TearDown();
  }
  [[nodiscard]] std::set<fs::path> kept() const {
    std::set<fs::path> all;
    if (fs::exists(folder_ + "/bundles"))
      for (const auto& entry : fs::directory_iterator(folder_ + "/bundles")) all.insert(entry.path());
    return all;
  }
  static std::string text_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::unique_ptr<JobRunner> inner_;
};

TEST_F(Bundles, ACrashKeepsSurfaceSpecificationAndRecord) {
  const std::string id = start("segv");
  const v1::Job job = wait(id).job;
  ASSERT_EQ(kept().size(), 1u);
  const fs::path bundle = *kept().begin();
  EXPECT_NE(job.error().message().find("kept as bundle " + bundle.filename().string()), std::string::npos) << job.error().message();
  EXPECT_NE(bundle.filename().string().find(id), std::string::npos);
  EXPECT_NE(text_of(bundle / "surface.stl").find("solid segv"), std::string::npos);
  EXPECT_NO_THROW(parse_spec(text_of(bundle / "spec.json")));
  EXPECT_NE(text_of(bundle / "job.json").find("break_down_here"), std::string::npos);
  EXPECT_NE(text_of(bundle / "README").find("strata mesh surface.stl --spec spec.json"), std::string::npos);
}

TEST_F(Bundles, OnlyFailuresOfOursAreKeptAndTheOldestGo) {
  wait(start("fine"));
  wait(start("greedy"));
  EXPECT_TRUE(kept().empty());
  wait(start("throw"));
  const std::set<fs::path> first = kept();
  ASSERT_EQ(first.size(), 1u);
  std::this_thread::sleep_for(1100ms);  // names count seconds
  wait(start("abort"));
  wait(start("exit"));
  EXPECT_EQ(kept().size(), 2u);
  EXPECT_FALSE(kept().contains(*first.begin()));
}

TEST_F(Bundles, ArraysBecomeAFileThatCanBeMeshed) {
  const double points[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::uint32_t triangles[] = {0, 2, 1, 0, 1, 3};
  const std::int32_t patches[] = {1, 0};
  const auto writer = blobs_->create("");
  for (const std::string_view piece : {std::string_view(reinterpret_cast<const char*>(points), sizeof points),
                                       std::string_view(reinterpret_cast<const char*>(triangles), sizeof triangles),
                                       std::string_view(reinterpret_cast<const char*>(patches), sizeof patches)})
    writer->write(piece);
  JobOrder order;
  order.job_id = random_id();
  v1::Surface& surface = *order.request.mutable_surface();
  surface.set_blob_id(writer->publish().id);
  surface.set_format(v1::SURFACE_FORMAT_ARRAYS);
  surface.mutable_arrays()->set_point_count(4);
  surface.mutable_arrays()->set_triangle_count(2);
  surface.mutable_arrays()->add_patch_names("segv");
  surface.mutable_arrays()->add_patch_names("wall");
  order.request.mutable_spec();
  order.request.add_outputs(v1::OUTPUT_FORMAT_BLOCKS);
  wait(start(std::move(order)));
  ASSERT_EQ(kept().size(), 1u);
  const std::string stl = text_of(*kept().begin() / "surface.stl");
  EXPECT_LT(stl.find("solid segv"), stl.find("solid wall"));
  EXPECT_NE(stl.find("vertex 0 0 1"), std::string::npos);
}

// Checks in processes of their own.
class ProcessChecker : public ProcessRunner {
 protected:
  Checked check(const std::string& surface, CheckDepth depth = CheckDepth::Cost) {
    const auto checker = make_process_checker(FAULTY_WORKER, *blobs_, memory_);
    return checker->check(order(surface, depth), stop_);
  }
  static CheckOrder order(const std::string& surface, CheckDepth depth) {
    CheckOrder order;
    order.surface.set_data("solid " + surface +
                           "\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n");
    order.surface.set_format(v1::SURFACE_FORMAT_STL);
    order.depth = depth;
    return order;
  }
  std::atomic<bool> stop_ = false;
};

TEST_F(ProcessChecker, TellsTheCostAndTheFindings) {
  EXPECT_EQ(check("fine").report.estimate().memory_bytes(), 1 << 20);
  const Checked all = check("fine", CheckDepth::All);
  EXPECT_FALSE(all.error);
  EXPECT_EQ(all.report.patches(0).name(), "fine");
}

TEST_F(ProcessChecker, WhatCouldNeverRunIsRefused) {
  const Checked greedy = check("greedy");
  ASSERT_TRUE(greedy.error);
  EXPECT_EQ(greedy.error->code(), 8);
  EXPECT_EQ(greedy.error->diagnostic().values().at("budget_bytes"), static_cast<double>(kMemory));
}

TEST_F(ProcessChecker, ABlobIsReadWhereItLies) {
  const auto writer = blobs_->create("");
  CheckOrder from_blob = order("fine", CheckDepth::Cost);
  writer->write(from_blob.surface.data());
  from_blob.surface.set_blob_id(writer->publish().id);
  EXPECT_TRUE(make_process_checker(FAULTY_WORKER, *blobs_, memory_)->check(from_blob, stop_).report.has_estimate());
  from_blob.surface.set_blob_id(random_id());
  EXPECT_TRUE(make_process_checker(FAULTY_WORKER, *blobs_, memory_)->check(from_blob, stop_).error);
}

TEST_F(ProcessChecker, AMalformedSurfaceIsAFinding) {
  CheckOrder bad = order("fine", CheckDepth::Cost);
  bad.surface.set_data("garbage");
  const Checked checked = make_process_checker(FAULTY_WORKER, *blobs_, memory_)->check(bad, stop_);
  EXPECT_FALSE(checked.error);
  EXPECT_FALSE(checked.report.acceptable());
  EXPECT_EQ(checked.report.findings(0).reason(), "FILE_MALFORMED");
}

TEST_F(ProcessChecker, ACrashIsTheChecksOwn) {
  const Checked crashed = check("segv_at_once");
  ASSERT_TRUE(crashed.error);
  EXPECT_EQ(crashed.error->reason(), "WORKER_CRASHED");
  EXPECT_NE(crashed.error->backtrace().find("break_down_here"), std::string::npos) << crashed.error->backtrace();
}

#if !defined(__SANITIZE_ADDRESS__)
TEST_F(ProcessChecker, ACheckThatNeedsMoreMemoryThanThereIsMeansThatTheJobWouldToo) {
  const Checked full = check("allocate_at_once");
  ASSERT_TRUE(full.error);
  EXPECT_EQ(full.error->code(), 8) << full.error->message();
}
#endif

TEST_F(ProcessChecker, AnEndlessCheckCanBeCancelled) {
  std::thread later([this] {
    std::this_thread::sleep_for(300ms);
    stop_ = true;
  });
  const auto begun = Clock::now();
  const Checked checked = check("loop_at_once");
  later.join();
  EXPECT_EQ(checked.error->code(), 1);
  EXPECT_LT(Clock::now() - begun, 2s);
}

TEST(MemoryLedger, ReservesUpToTheBudgetAndRefusesWhatCanNeverBe) {
  MemoryLedger ledger(100);
  EXPECT_TRUE(ledger.try_reserve("a", 60));
  EXPECT_FALSE(ledger.try_reserve("b", 60));
  EXPECT_TRUE(ledger.try_reserve("b", 40));
  EXPECT_THROW(static_cast<void>(ledger.try_reserve("c", 101)), MeshError);
  ledger.release("a");
  EXPECT_TRUE(ledger.try_reserve("b", 100)) << "a new reservation replaces the old one";
  EXPECT_EQ(ledger.reserved(), 100);
}

TEST(MessageSplitter, GivesWholeMessagesHoweverTheyAreCut) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  v1::Blob a, b;
  a.set_blob_id("first");
  b.set_blob_id(std::string(1000, 'x'));
  ASSERT_TRUE(write_message(ends[1], a) && write_message(ends[1], b));
  std::string bytes(4096, '\0');
  bytes.resize(static_cast<std::size_t>(read(ends[0], bytes.data(), bytes.size())));
  close(ends[0]);
  close(ends[1]);
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    MessageSplitter splitter;
    std::vector<std::string> messages;
    for (const std::string& piece : {bytes.substr(0, cut), bytes.substr(cut)}) {
      splitter.add(piece);
      while (auto message = splitter.next()) messages.push_back(std::move(*message));
    }
    ASSERT_EQ(messages.size(), 2u) << "cut at " << cut;
    EXPECT_EQ(messages[1], b.SerializeAsString());
  }
}

TEST(MessageSplitter, StopsAtALengthNobodySends) {
  MessageSplitter splitter;
  splitter.add("\xff\xff\xff\xff and more");
  EXPECT_FALSE(splitter.next());
  EXPECT_TRUE(splitter.damaged());
}

TEST(Backtrace, NamesCallsAndLeavesOutTheHandler) {
  const std::string text =
      "noise\n== backtrace\nstratad(+0x12) [0x1]\n== backtrace\nstratad(_ZN6strata6server12_GLOBAL__N_18on_crashEi+0x1) [0x1]\n"
      "/lib/x86_64-linux-gnu/libc.so.6(+0x3c050) [0x2]\nstratad(_ZN6strata5carveEv+0x1f) [0x3]\n/usr/bin/stratad(main+0x3) [0x4]\n";
  EXPECT_EQ(backtrace_in(text, ""), "strata::carve()\nmain\n");
  EXPECT_EQ(backtrace_in("nothing", ""), "");
}

}  // namespace
}  // namespace strata::server
