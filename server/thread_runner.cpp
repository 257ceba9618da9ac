#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "core/mesher.h"
#include "server/job_runner.h"

namespace strata::server {
namespace {

class ThreadRunner final : public JobRunner {
 public:
  ThreadRunner(int slots, BlobStore& blobs, MemoryLedger& memory, MesherDoor mesher)
      : blobs_(blobs), memory_(memory), mesher_(std::move(mesher)) {
    for (int i = 0; i < slots; ++i) threads_.emplace_back([this](const std::stop_token& stop) { serve(stop); });
  }

  ~ThreadRunner() override {
    {
      const std::lock_guard lock(mutex_);
      for (auto& [id, cancelled] : cancelled_) *cancelled = true;
    }
    threads_.clear();  // asks each to stop, then joins
  }

  int slots() const override { return static_cast<int>(threads_.size()); }

  void start(JobOrder order, EventSink on_event, Done on_done) override {
    const std::lock_guard lock(mutex_);
    cancelled_[order.job_id] = std::make_shared<std::atomic<bool>>(false);
    waiting_.push_back({std::move(order), std::move(on_event), std::move(on_done)});
    changed_.notify_one();
  }

  void cancel(const std::string& job_id, Stop) override {
    const std::lock_guard lock(mutex_);
    const auto found = cancelled_.find(job_id);
    if (found != cancelled_.end()) *found->second = true;
  }

 private:
  struct Task {
    JobOrder order;
    EventSink on_event;
    Done on_done;
  };

  void serve(const std::stop_token& stop) {
    while (true) {
      Task task;
      std::shared_ptr<std::atomic<bool>> cancelled;
      {
        std::unique_lock lock(mutex_);
        if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return;
        task = std::move(waiting_.front());
        waiting_.pop_front();
        cancelled = cancelled_[task.order.job_id];
      }
      task.order.memory_budget_bytes = memory_.budget();
      const MemoryGate gate = [&](const Estimate& estimate) { wait_for_memory(task.order.job_id, estimate, *cancelled); };
      v1::Job result = run_mesh_job(task.order, blobs_, mesher_, *cancelled, gate, task.on_event);
      memory_.release(task.order.job_id);
      {
        const std::lock_guard lock(mutex_);
        cancelled_.erase(task.order.job_id);
      }
      task.on_done(std::move(result));
    }
  }

  void wait_for_memory(const std::string& job_id, const Estimate& estimate, const std::atomic<bool>& cancelled) {
    constexpr std::chrono::milliseconds kLook{20};
    const Context context(&cancelled, {});
    for (; !memory_.try_reserve(job_id, estimate.memory_bytes); std::this_thread::sleep_for(kLook)) context.checkpoint();
  }

  BlobStore& blobs_;
  MemoryLedger& memory_;
  MesherDoor mesher_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Task> waiting_;
  std::map<std::string, std::shared_ptr<std::atomic<bool>>> cancelled_;
  std::vector<std::jthread> threads_;
};

}  // namespace

std::unique_ptr<JobRunner> make_thread_runner(int slots, BlobStore& blobs, MemoryLedger& memory, MesherDoor mesher) {
  return std::make_unique<ThreadRunner>(slots, blobs, memory, std::move(mesher));
}

}  // namespace strata::server
