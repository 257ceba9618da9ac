#include <spdlog/spdlog.h>

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "server/job_attempt.h"
#include "server/job_error.h"
#include "server/job_log.h"
#include "server/job_runner.h"

namespace strata::server {
namespace {

constexpr int kMaxAttempts = 2;
constexpr std::int64_t kLeastMemory = std::int64_t{1} << 30;

struct Task {
  JobOrder order;
  EventSink on_event;
  JobRunner::Done on_done;
};

class ProcessRunner final : public JobRunner {
 public:
  ProcessRunner(const ProcessOptions& options, BlobStore& blobs, MemoryLedger& memory) : options_(options), blobs_(blobs), memory_(memory) {
    for (int i = 0; i < options.slots; ++i) threads_.emplace_back([this](const std::stop_token& stop) { serve(stop); });
  }

  ~ProcessRunner() override {
    {
      const std::lock_guard lock(mutex_);
      for (auto& [id, stop] : stops_) *stop = 1 + static_cast<int>(Stop::Cancelled);
    }
    threads_.clear();  // asks each to stop, then joins
  }

  int slots() const override { return options_.slots; }

  void start(JobOrder order, EventSink on_event, Done on_done) override {
    const std::lock_guard lock(mutex_);
    stops_[order.job_id] = std::make_shared<StopFlag>(0);
    waiting_.push_back({std::move(order), std::move(on_event), std::move(on_done)});
    changed_.notify_one();
  }

  void cancel(const std::string& job_id, Stop why) override {
    const std::lock_guard lock(mutex_);
    const auto found = stops_.find(job_id);
    if (found == stops_.end()) return;
    int none = 0;
    found->second->compare_exchange_strong(none, 1 + static_cast<int>(why));
  }

 private:
  void serve(const std::stop_token& stop) {
    while (true) {
      Task task;
      std::shared_ptr<StopFlag> stop_flag;
      {
        std::unique_lock lock(mutex_);
        if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return;
        task = std::move(waiting_.front());
        waiting_.pop_front();
        stop_flag = stops_[task.order.job_id];
      }
      v1::Job result = run(task, *stop_flag);
      if (*stop_flag == 1 + static_cast<int>(Stop::OutOfTime)) result = out_of_time(std::move(result));
      {
        const std::lock_guard lock(mutex_);
        stops_.erase(task.order.job_id);
      }
      task.on_done(std::move(result));
    }
  }

  v1::Job run(const Task& task, const StopFlag& stop) {
    std::int64_t memory_limit = std::max(memory_.budget() / options_.slots, std::min(kLeastMemory, memory_.budget()));
    for (int number = 1;; ++number) {
      const auto [job, again, all_memory] = attempt(task, number, memory_limit, stop);
      if (!again || number == kMaxAttempts || stop != 0) return job;
      log_crash(task.order.job_id, number, job.error());
      if (all_memory) memory_limit = memory_.budget();
      tell_attempt(task, number + 1);
    }
  }

  Tried attempt(const Task& task, int number, std::int64_t memory_limit, const StopFlag& stop) {
    try {
      return attempt_job(options_.program, task.order, number, memory_limit, blobs_, memory_, task.on_event, stop);
    } catch (const std::exception& error) {
      return {ended_badly(job_error(13, "WORKER_FAILED", std::string("no worker could be started: ") + error.what())), true, false};
    }
  }

  static void tell_attempt(const Task& task, int number) {
    v1::WatchJobResponse event;
    event.mutable_state_changed()->set_state(v1::JOB_STATE_RUNNING);
    event.mutable_state_changed()->set_attempt(number);
    task.on_event(std::move(event));
  }

  static void log_crash(const std::string& job_id, int number, const v1::JobError& error) {
    spdlog::error(R"("msg":"worker lost","job":"{}","attempt":{},"reason":"{}","stage":"{}","error":"{}","backtrace":"{}")", job_id, number,
                  error.reason(), v1::Stage_Name(error.stage()), json_escaped(error.message()), json_escaped(error.backtrace()));
  }

  const ProcessOptions options_;
  BlobStore& blobs_;
  MemoryLedger& memory_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Task> waiting_;
  std::map<std::string, std::shared_ptr<StopFlag>> stops_;
  std::vector<std::jthread> threads_;
};

}  // namespace

std::unique_ptr<JobRunner> make_process_runner(const ProcessOptions& options, BlobStore& blobs, MemoryLedger& memory) {
  return std::make_unique<ProcessRunner>(options, blobs, memory);
}

}  // namespace strata::server
