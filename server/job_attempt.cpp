#include "server/job_attempt.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "core/base/diagnostic.h"
#include "server/convert.h"
#include "server/job_error.h"
#include "server/refusal.h"
#include "server/worker_process.h"
#include "strata/worker/v1/worker.pb.h"

namespace strata::server {
namespace {

namespace wire = strata::worker::v1;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPatience{500};     // from cancel to kill: the promise is a second
constexpr std::chrono::milliseconds kForBacktrace{200}; // of a worker that is out of time

double seconds(const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); }

v1::Job failed_job(int code, const std::string& reason, const std::string& message) {
  return ended_badly(job_error(code, reason, message));
}

// One worker process and what it is told and tells.
class Attempt {
 public:
  Attempt(const std::string& program, const JobOrder& order, int number, std::int64_t memory_limit, BlobStore& blobs, MemoryLedger& memory,
          const EventSink& on_event, const StopFlag& stop)
      : order_(order),
        on_event_(on_event),
        blobs_(blobs),
        memory_(memory),
        stop_(stop),
        folder_(blobs.stage(order.job_id + "-" + std::to_string(number))),
        started_(Clock::now()),
        worker_(program),
        memory_limit_(memory_limit) {}
  ~Attempt() {
    blobs_.unstage(folder_);
    memory_.release(order_.job_id);
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
    order.set_job_id(order_.job_id);
    *order.mutable_request() = order_.request;
    order.set_threads(order_.threads);
    const std::string& surface = order_.request.surface().blob_id();
    order.set_surface_path(blobs_.local_path(surface));
    order.set_surface_bytes(blobs_.find(surface)->size);
    order.set_staging_folder(folder_);
    order.set_memory_limit_bytes(memory_limit_);
    order.set_memory_budget_bytes(memory_.budget());
    order.set_results_outlive_power_loss(blobs_.durability() == Durability::PowerLoss);
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
      on_event_(std::move(*report.mutable_event()));
    }
    if (report.has_estimate()) asked_ = report.estimate().memory_bytes();
    if (report.has_result()) result_ = std::move(*report.mutable_result()->mutable_job());
  }

  void grant_when_there_is_room() {
    try {
      if (!memory_.try_reserve(order_.job_id, *asked_)) return;
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
        blobs_.adopt(folder_, {artifact.blob().blob_id(), artifact.blob().size_bytes(), artifact.blob().sha256(), order_.owner});
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
      if (asked_where_) job.mutable_error()->set_backtrace(worker_.backtrace());
    } else if (ran_out_of_memory(end)) {
      out_of_memory_ = crashed_ = memory_limit_ < memory_.budget();
      job = failed_job(8, "MEMORY_BUDGET_EXCEEDED",
                       "the job needed more than " + std::to_string(memory_limit_ >> 20) + " MiB of memory: ask for larger cells");
    } else {
      crashed_ = true;
      job = failed_job(13, "WORKER_CRASHED", "the worker process of the job ended by " + how_it_ended(end) + in_stage());
      job.mutable_error()->set_backtrace(worker_.backtrace());
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

  const JobOrder& order_;
  const EventSink& on_event_;
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

}  // namespace

Tried attempt_job(const std::string& program, const JobOrder& order, int number, std::int64_t memory_limit, BlobStore& blobs,
                  MemoryLedger& memory, const EventSink& on_event, const StopFlag& stop) {
  Attempt one(program, order, number, memory_limit, blobs, memory, on_event, stop);
  v1::Job job = one.run();
  return {std::move(job), one.crashed(), one.was_out_of_memory()};
}

}  // namespace strata::server
