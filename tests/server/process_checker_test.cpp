// Checks in processes of their own.
#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "server/checker.h"
#include "tests/server/process_fixture.h"

namespace strata::server {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

class ProcessChecker : public ProcessFixture {
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
  EXPECT_EQ(greedy.error->diagnostic().values().at("budget_bytes"), static_cast<double>(memory_.budget()));
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

}  // namespace
}  // namespace strata::server
