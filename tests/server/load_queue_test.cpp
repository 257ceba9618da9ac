// Many jobs in the queue, many watchers.
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "tests/server/load_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;

// Follows a job for as long as it lives.
class Follower final : public grpc::ClientReadReactor<v1::WatchJobResponse> {
 public:
  Follower(v1::JobService::Stub& stub, const std::string& job_id) {
    request_.set_job_id(job_id);
    stub.async()->WatchJob(&context_, &request_, this);
    StartRead(&event_);
    StartCall();
  }
  ~Follower() override {
    context_.TryCancel();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return over_; });
  }
  void OnReadDone(bool ok) override {
    if (!ok) return;
    ++heard_;
    StartRead(&event_);
  }
  void OnDone(const grpc::Status&) override {
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_all();
  }
  [[nodiscard]] int heard() const { return heard_; }

 private:
  grpc::ClientContext context_;
  v1::WatchJobRequest request_;
  v1::WatchJobResponse event_;
  std::atomic<int> heard_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool over_ = false;
};

TEST_F(Load, ALongQueueAndManyWatchersSlowNobodyDown) {
  const int queued = is_long() ? 10'000 : 1'000, watchers = is_long() ? 1'000 : 100;
  start({"--slots", "1", "--queue", "20000"});
  const std::string surface = ball(28);
  submit(job_of(surface, v1::SURFACE_FORMAT_OFF, 0.012));  // meshes all the while
  std::vector<std::string> ids;
  std::vector<double> submits, lists;
  std::vector<std::unique_ptr<Follower>> followers;
  std::vector<std::shared_ptr<grpc::Channel>> channels;
  std::vector<std::unique_ptr<v1::JobService::Stub>> stubs;
  for (int c = 0; c < 10; ++c) {
    channels.push_back(daemon_->connect());
    stubs.push_back(v1::JobService::NewStub(channels.back()));
  }
  const v1::CreateJobRequest small = job_of(ball(8), v1::SURFACE_FORMAT_OFF, 0.3);
  const std::int64_t before = daemon_->resident_bytes();
  for (int i = 0; i < queued; ++i) {
    v1::CreateJobRequest request = small;
    request.set_request_id(std::to_string(i));
    const auto begun = Clock::now();
    ids.push_back(submit(request));
    submits.push_back(seconds_since(begun));
    if (i % (queued / watchers) == 0) followers.push_back(std::make_unique<Follower>(*stubs[followers.size() % 10], ids.back()));
    if (i % (queued / 50) == 0) {
      const auto asked = Clock::now();
      list();
      lists.push_back(seconds_since(asked));
    }
  }
  for (const auto until = Clock::now() + 60s; Clock::now() < until; std::this_thread::sleep_for(100ms))
    if (std::all_of(followers.begin(), followers.end(), [](const auto& f) { return f->heard() > 0; })) break;
  for (const auto& follower : followers) EXPECT_GT(follower->heard(), 0);
  const std::int64_t resident = daemon_->resident_bytes();
  std::printf("%d queued jobs, %zu watchers: submit p50 %.1f ms, p99 %.1f ms; list p99 %.1f ms; server %lld MiB (%lld before)\n", queued,
              followers.size(), 1e3 * quantile(submits, 0.5), 1e3 * quantile(submits, 0.99), 1e3 * quantile(lists, 0.99),
              static_cast<long long>(resident / kMiB), static_cast<long long>(before / kMiB));
  EXPECT_LT(quantile(submits, 0.99), 0.05 * slowness());
  EXPECT_LT(quantile(lists, 0.99), 0.05 * slowness());
  EXPECT_LT(resident, 1024 * kMiB);
  followers.clear();

  // And all of them are there after a crash.
  const std::string folder = daemon_->folder();
  daemon_->kill(SIGKILL);
  const Daemon again({"--slots", "1", "--queue", "20000"}, folder);
  std::printf("ready again after %.2f s\n", again.time_to_ready().count());
  EXPECT_LT(again.time_to_ready().count(), 5 * slowness());
  const auto stub = v1::SystemService::NewStub(again.connect());
  grpc::ClientContext context;
  v1::GetServerStatusResponse status;
  ASSERT_TRUE(stub->GetServerStatus(&context, {}, &status).ok());
  EXPECT_EQ(status.jobs_total(), queued + 1);
}

}  // namespace
}  // namespace strata::server
