// Cancels at any moment; thousands of small jobs.
#include <cstdio>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/server/load_fixture.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

TEST_F(Load, CancelAtAnyMomentEndsAJobOnceAndSoon) {
  const int rounds = is_long() ? 500 : 25;
  start({"--slots", "2", "--cores", "2"});
  const v1::CreateJobRequest request = job_of(ball(20), v1::SURFACE_FORMAT_OFF, 0.1);
  std::mt19937 dice(5);
  std::vector<double> waits;
  int cancelled = 0;
  for (int round = 0; round < rounds; ++round) {
    const std::string id = submit(request);
    std::this_thread::sleep_for(std::chrono::microseconds(std::uniform_int_distribution(0, 500'000)(dice)));
    const auto begun = Clock::now();
    cancel(id);
    const auto events = watch(id);
    waits.push_back(seconds_since(begun));
    const auto ends = std::count_if(events.begin(), events.end(), [](const auto& e) { return is_final(e.state_changed().state()); });
    EXPECT_EQ(ends, 1);
    const v1::Job job = get(id);
    EXPECT_EQ(job.state(), events.back().done().state());
    if (job.state() == v1::JOB_STATE_CANCELLED) ++cancelled;
    else EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
    EXPECT_EQ(job.state() == v1::JOB_STATE_SUCCEEDED, job.artifacts_size() > 0);
  }
  std::printf("%d cancels, %d before the end: final after p50 %.0f ms, p99 %.0f ms\n", rounds, cancelled, 1e3 * quantile(waits, 0.5),
              1e3 * quantile(waits, 0.99));
  EXPECT_GT(cancelled, rounds / 4);
  EXPECT_LT(quantile(waits, 0.99), 1 * slowness());
  EXPECT_TRUE(fs::is_empty(daemon_->folder() + "/data/temporary")) << "a cancelled job leaves nothing";
  EXPECT_EQ(watch(submit(request)).back().done().state(), v1::JOB_STATE_SUCCEEDED) << "the slots are free again";
}

TEST_F(Load, ManySmallJobsLeaveNothingBehind) {
  const int rounds = is_long() ? 5'000 : 200;
  start({"--slots", "2", "--worker-program", FAULTY_WORKER});
  const auto run = [&](int count) {
    for (int i = 0; i < count; i += 20) {
      std::vector<std::string> ids;
      for (int k = 0; k < 20; ++k) ids.push_back(submit(job_of(word("fine"), v1::SURFACE_FORMAT_STL)));
      for (const std::string& id : ids) EXPECT_EQ(watch(id).back().done().state(), v1::JOB_STATE_SUCCEEDED);
    }
  };
  const auto begun = Clock::now();
  run(rounds / 4);  // caches fill, threads come up
  const std::int64_t before = daemon_->resident_bytes();
  run(rounds);
  const std::int64_t grown = daemon_->resident_bytes() - before;
  std::printf("%d small jobs in %.0f s: the server grew by %.2f MiB\n", rounds + rounds / 4, seconds_since(begun),
              static_cast<double>(grown) / kMiB);
  EXPECT_LT(grown, 16 * kMiB);
  EXPECT_TRUE(fs::is_empty(daemon_->folder() + "/data/temporary"));
}

}  // namespace
}  // namespace strata::server
