#include <spdlog/spdlog.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/diagnostic.h"
#include "server/backtrace.h"
#include "server/convert.h"
#include "server/job_error.h"
#include "server/job_log.h"
#include "server/job_runner.h"
#include "server/refusal.h"
#include "server/worker_process.h"
#include "strata/worker/v1/worker.pb.h"

namespace strata::server {
namespace {

namespace wire = strata::worker::v1;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPatience{500};     // from cancel to kill: the promise is a second
constexpr std::chrono::milliseconds kForBacktrace{200}; // of a worker that is out of time
constexpr int kMaxAttempts = 2;
constexpr std::int64_t kLeastMemory = std::int64_t{1} << 30;

struct Task {
  JobOrder order;
  EventSink on_event;
  JobRunner::Done on_done;
};

// 0: go on; else 1 + Stop.
using StopFlag = std::atomic<int>;

double seconds(const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

v1::Job failed_job(int code, const std::string& reason, const std::string& message) {
  return ended_badly(job_error(code, reason, message));
}

// One worker process and what it is told and tells.
class Attempt {
 public:
  Attempt(const std::string& program, const Task& task, int number, std::int64_t memory_limit, BlobStore& blobs, MemoryLedger& memory,
          const StopFlag& stop)
      : task_(task),
        blobs_(blobs),
        memory_(memory),
        stop_(stop),
        folder_(blobs.stage(task.order.job_id + "-" + std::to_string(number))),
        started_(Clock::now()),
        worker_(program),
        memory_limit_(memory_limit) {}
  ~Attempt() {
    blobs_.unstage(folder_);
    memory_.release(task_.order.job_id);
  }
  Attempt(const Attempt&) = delete;
  Attempt& operator=(const Attempt&) = delete;

  v1::Job run() {
    send_order();
    while (look()) worker_.wait_a_little();
    const ChildEnd end = worker_.end();
    v1::Job job = result_ && !killed_ ? adopt() : judge(end);
    add_usage(end, job);
    return job;
  }

  // Another try may do better.
  [[nodiscard]] bool crashed() const { return crashed_; }
  [[nodiscard]] bool was_out_of_memory() const { return out_of_memory_; }

 private:
  void send_order() {
    wire::Command command;
    wire::Order& order = *command.mutable_order();
    order.set_job_id(task_.order.job_id);
    *order.mutable_request() = task_.order.request;
    order.set_threads(task_.order.threads);
    const std::string& surface = task_.order.request.surface().blob_id();
    order.set_surface_path(blobs_.local_path(surface));
    order.set_surface_bytes(blobs_.find(surface)->size);
    order.set_staging_folder(folder_);
    order.set_memory_limit_bytes(memory_limit_);
    worker_.tell(command);
  }

  // False when the worker is done.
  bool look() {
    if (!worker_.look([this](wire::Report& report) { hear(report); })) return false;
    heed_stop();
    if (asked_) grant_when_there_is_room();
    return true;
  }

  void hear(wire::Report& report) {
    if (report.has_event()) {
      if (report.event().has_progress()) stage_ = report.event().progress().stage();
      task_.on_event(std::move(*report.mutable_event()));
    }
    if (report.has_estimate()) asked_ = report.estimate().memory_bytes();
    if (report.has_result()) result_ = std::move(*report.mutable_result()->mutable_job());
  }

  void grant_when_there_is_room() {
    try {
      if (!memory_.try_reserve(task_.order.job_id, *asked_)) return;
    } catch (const MeshError& error) {
      refused_ = to_wire(error);
      killed_ = true;
      return worker_.kill();
    }
    wire::Command command;
    memory_limit_ = std::max(memory_limit_, std::min(memory_limit_for(*asked_), memory_.budget()));
    command.mutable_grant()->set_memory_limit_bytes(memory_limit_);
    worker_.tell(command);
    asked_.reset();
  }

  void heed_stop() {
    if (stop_ == 0) return;
    const Clock::time_point now = Clock::now();
    if (!told_) {
      told_ = now;
      wire::Command command;
      command.mutable_cancel();
      worker_.tell(command);
      return;
    }
    if (now - *told_ < kPatience) return;
    if (stop_ == 1 + static_cast<int>(Stop::OutOfTime) && !asked_where_) {
      asked_where_ = now;
      return worker_.ask_where();
    }
    if (asked_where_ && now - *asked_where_ < kForBacktrace) return;
    killed_ = true;
    worker_.kill();
  }

  // The results of a worker that finished.
  v1::Job adopt() {
    try {
      for (const v1::Artifact& artifact : result_->artifacts())
        blobs_.adopt(folder_, {artifact.blob().blob_id(), artifact.blob().size_bytes(), artifact.blob().sha256(), task_.order.owner});
    } catch (const Refusal& refusal) {
      for (const v1::Artifact& artifact : result_->artifacts()) blobs_.remove(artifact.blob().blob_id());
      return failed_job(refusal.kind == Refused::ResourceExhausted ? 8 : 13, refusal.reason, refusal.what());
    }
    out_of_memory_ = crashed_ = result_->error().reason() == "MEMORY_BUDGET_EXCEEDED" && memory_limit_ < memory_.budget();
    return std::move(*result_);
  }

  // A worker that ended without a result.
  v1::Job judge(const ChildEnd& end) {
    v1::Job job;
    if (refused_) {
      job.set_state(v1::JOB_STATE_FAILED);
      *job.mutable_error() = *refused_;
    } else if (stop_ != 0) {
      job = failed_job(1, "CANCELLED", "the run was cancelled");
      if (asked_where_) job.mutable_error()->set_backtrace(backtrace_in(worker_.errors()));
    } else if (ran_out_of_memory(end)) {
      out_of_memory_ = crashed_ = memory_limit_ < memory_.budget();
      job = failed_job(8, "MEMORY_BUDGET_EXCEEDED",
                       "the job needed more than " + std::to_string(memory_limit_ >> 20) + " MiB of memory: ask for larger cells");
    } else {
      crashed_ = true;
      job = failed_job(13, "WORKER_CRASHED", "the worker process of the job ended by " + how_it_ended(end) + in_stage());
      job.mutable_error()->set_backtrace(backtrace_in(worker_.errors()));
    }
    job.mutable_error()->set_stage(stage_);
    return job;
  }

  [[nodiscard]] std::string in_stage() const {
    return stage_ == v1::STAGE_UNSPECIFIED ? " before the first stage" : " in " + v1::Stage_Name(stage_);
  }

  void add_usage(const ChildEnd& end, v1::Job& job) const {
    v1::Usage& usage = *job.mutable_usage();
    usage.set_wall_seconds(std::chrono::duration<double>(Clock::now() - started_).count());
    usage.set_cpu_seconds(seconds(end.usage.ru_utime) + seconds(end.usage.ru_stime));
    usage.set_peak_memory_bytes(static_cast<std::int64_t>(end.usage.ru_maxrss) * 1024);  // Linux counts in KiB
  }

  const Task& task_;
  BlobStore& blobs_;
  MemoryLedger& memory_;
  const StopFlag& stop_;
  const std::string folder_;
  const Clock::time_point started_;
  WorkerProcess worker_;
  std::int64_t memory_limit_;
  v1::Stage stage_ = v1::STAGE_UNSPECIFIED;
  std::optional<std::int64_t> asked_;  // memory, not granted yet
  std::optional<Clock::time_point> told_, asked_where_;
  std::optional<v1::JobError> refused_;
  std::optional<v1::Job> result_;
  bool killed_ = false, crashed_ = false, out_of_memory_ = false;
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

  struct Tried {
    v1::Job job;
    bool again = false, all_memory = false;
  };
  Tried attempt(const Task& task, int number, std::int64_t memory_limit, const StopFlag& stop) {
    try {
      Attempt one(options_.program, task, number, memory_limit, blobs_, memory_, stop);
      v1::Job job = one.run();
      return {std::move(job), one.crashed(), one.was_out_of_memory()};
    } catch (const std::exception& error) {
      return {failed_job(13, "WORKER_FAILED", std::string("no worker could be started: ") + error.what()), true, false};
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
