#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "core/mesher.h"
#include "server/job_error.h"
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
      for (auto& [id, stop] : stops_) stop->now = true;
    }
    threads_.clear();  // asks each to stop, then joins
  }

  int slots() const override { return static_cast<int>(threads_.size()); }

  void start(JobOrder order, EventSink on_event, Done on_done) override {
    const std::lock_guard lock(mutex_);
    stops_[order.job_id] = std::make_shared<StopOrder>();
    waiting_.push_back({std::move(order), std::move(on_event), std::move(on_done)});
    changed_.notify_one();
  }

  void cancel(const std::string& job_id, Stop why) override {
    const std::lock_guard lock(mutex_);
    const auto found = stops_.find(job_id);
    if (found == stops_.end() || found->second->now) return;
    found->second->why = why;
    found->second->now = true;
  }

 private:
  struct Task {
    JobOrder order;
    EventSink on_event;
    Done on_done;
  };
  struct StopOrder {
    Stop why = Stop::Cancelled;  // told before `now`, and not again
    std::atomic<bool> now = false;
  };

  void serve(const std::stop_token& stop) {
    while (true) {
      Task task;
      std::shared_ptr<StopOrder> stop_order;
      {
        std::unique_lock lock(mutex_);
        if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return;
        task = std::move(waiting_.front());
        waiting_.pop_front();
        stop_order = stops_[task.order.job_id];
      }
      task.order.memory_budget_bytes = memory_.budget();
      const MemoryGate gate = [&](const Estimate& estimate) { wait_for_memory(task.order.job_id, estimate, stop_order->now); };
      v1::Job result = run_mesh_job(task.order, blobs_, mesher_, stop_order->now, gate, task.on_event);
      if (stop_order->now && stop_order->why == Stop::OutOfTime) result = out_of_time(std::move(result));
      memory_.release(task.order.job_id);
      {
        const std::lock_guard lock(mutex_);
        stops_.erase(task.order.job_id);
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
  std::map<std::string, std::shared_ptr<StopOrder>> stops_;
  std::vector<std::jthread> threads_;
};

}  // namespace

std::unique_ptr<JobRunner> make_thread_runner(int slots, BlobStore& blobs, MemoryLedger& memory, MesherDoor mesher) {
  return std::make_unique<ThreadRunner>(slots, blobs, memory, std::move(mesher));
}

}  // namespace strata::server
