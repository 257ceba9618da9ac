#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "server/job_runner.h"

namespace strata::server {
namespace {

class ThreadRunner final : public JobRunner {
 public:
  ThreadRunner(int slots, BlobStore& blobs, MesherDoor mesher) : blobs_(blobs), mesher_(std::move(mesher)) {
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

  void cancel(const std::string& job_id) override {
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
      v1::Job result = run_mesh_job(task.order, blobs_, mesher_, *cancelled, task.on_event);
      {
        const std::lock_guard lock(mutex_);
        cancelled_.erase(task.order.job_id);
      }
      task.on_done(std::move(result));
    }
  }

  BlobStore& blobs_;
  MesherDoor mesher_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Task> waiting_;
  std::map<std::string, std::shared_ptr<std::atomic<bool>>> cancelled_;
  std::vector<std::jthread> threads_;
};

}  // namespace

std::unique_ptr<JobRunner> make_thread_runner(int slots, BlobStore& blobs, MesherDoor mesher) {
  return std::make_unique<ThreadRunner>(slots, blobs, std::move(mesher));
}

}  // namespace strata::server
