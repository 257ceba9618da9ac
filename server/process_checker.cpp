#include <poll.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <string>
#include <utility>

#include "server/checker.h"
#include "server/job_error.h"
#include "server/refusal.h"
#include "server/worker_process.h"
#include "strata/worker/v1/worker.pb.h"

namespace strata::server {
namespace {

namespace wire = strata::worker::v1;

class ProcessChecker final : public Checker {
 public:
  ProcessChecker(std::string program, const BlobStore& blobs, const MemoryLedger& memory)
      : program_(std::move(program)), blobs_(blobs), memory_(memory) {}

  Checked check(const CheckOrder& order, const std::atomic<bool>& cancelled) override {
    try {
      return ask(command_for(order), cancelled);
    } catch (const std::exception& error) {
      return {{}, job_error(13, "WORKER_FAILED", std::string("no worker could be started: ") + error.what())};
    }
  }

 private:
  // What running jobs have reserved is theirs; a check is small beside its job, but not always.
  [[nodiscard]] std::int64_t memory_limit() const {
    constexpr std::int64_t kLeast = std::int64_t{1} << 30;
    return std::max(memory_.budget() - memory_.reserved(), std::min(kLeast, memory_.budget()));
  }

  wire::Command command_for(const CheckOrder& order) const {
    wire::Command command;
    wire::Check& check = *command.mutable_check();
    *check.mutable_surface() = order.surface;
    if (!order.surface.has_data()) {
      const BlobInfo blob = found_blob(blobs_, order.surface.blob_id());
      check.set_surface_path(blobs_.local_path(blob.id));
      check.set_surface_bytes(blob.size);
    }
    *check.mutable_spec() = order.spec;
    check.set_threads(order.threads);
    check.set_cost_only(order.depth == CheckDepth::Cost);
    check.set_memory_budget_bytes(memory_.budget());
    check.set_memory_limit_bytes(memory_limit());
    return command;
  }

  [[nodiscard]] Checked ask(const wire::Command& command, const std::atomic<bool>& cancelled) const {
    WorkerProcess worker(program_);
    worker.tell(command);
    std::optional<wire::Checked> answer;
    const auto hear = [&](wire::Report& report) {
      if (report.has_checked()) answer = std::move(*report.mutable_checked());
    };
    bool stopped = false;
    while (worker.look(hear)) {
      if (cancelled) {
        worker.kill();  // it holds nothing that matters
        stopped = true;
      }
      worker.wait_a_little();
    }
    const ChildEnd end = worker.end();
    if (answer) return {std::move(*answer->mutable_report()), answer->has_error() ? std::optional(answer->error()) : std::nullopt};
    if (stopped) return {{}, job_error(1, "CANCELLED", "the check was cancelled")};
    if (ran_out_of_memory(end)) {
      const std::string limit = std::to_string(command.check().memory_limit_bytes() >> 20);
      return {
          {},
          job_error(8, "MEMORY_BUDGET_EXCEEDED", "looking at the surface alone needs more than " + limit + " MiB: ask for larger cells")};
    }
    v1::JobError crashed = job_error(13, "WORKER_CRASHED", "the worker process of the check ended by " + how_it_ended(end));
    crashed.set_backtrace(worker.backtrace());
    return {{}, std::move(crashed)};
  }

  const std::string program_;
  const BlobStore& blobs_;
  const MemoryLedger& memory_;
};

}  // namespace

std::unique_ptr<Checker> make_process_checker(std::string program, const BlobStore& blobs, const MemoryLedger& memory) {
  return std::make_unique<ProcessChecker>(std::move(program), blobs, memory);
}

}  // namespace strata::server
