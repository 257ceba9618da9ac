#include "server/worker.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/mesher.h"
#include "server/backtrace.h"
#include "server/check_run.h"
#include "server/convert.h"
#include "server/mesh_job.h"
#include "server/pipe_messages.h"
#include "server/refusal.h"
#include "server/staged_blobs.h"
#include "server/stored_file.h"
#include "strata/worker/v1/worker.pb.h"

namespace strata::server {
namespace {

namespace wire = strata::worker::v1;

[[noreturn]] void out_of_memory() { _exit(kOutOfMemoryExit); }

void limit_memory([[maybe_unused]] std::int64_t bytes) {
#ifndef __SANITIZE_ADDRESS__  // its shadow is far larger than any limit
  if (bytes <= 0) return;
  rlimit limit{};
  getrlimit(RLIMIT_DATA, &limit);
  limit.rlim_cur = static_cast<rlim_t>(bytes);
  setrlimit(RLIMIT_DATA, &limit);
#endif
}

// Dies with the server, is the first to go when memory runs out, leaves no core files, holds none of the server's files.
bool settle(pid_t server) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != server) return false;
  std::signal(SIGPIPE, SIG_IGN);
  close_range(STDERR_FILENO + 1, ~0U, 0);
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  std::ofstream("/proc/self/oom_score_adj") << 500;
  report_crashes();
  std::set_new_handler(out_of_memory);
  return true;
}

// What the server says while the job runs.
class Orders {
 public:
  explicit Orders(int fd) : thread_([this, fd] { listen(fd); }) { thread_.detach(); }

  [[nodiscard]] const std::atomic<bool>& cancelled() const { return cancelled_; }
  // Waits; throws MeshError(Cancelled) instead when that comes first.
  void wait_for_grant() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return granted_ || cancelled_; });
    Context(&cancelled_, {}).checkpoint();
  }

 private:
  void listen(int fd) {
    wire::Command command;
    while (read_message(fd, command)) {
      const std::lock_guard lock(mutex_);
      if (command.has_grant()) {
        limit_memory(command.grant().memory_limit_bytes());
        granted_ = true;
      }
      if (command.has_cancel()) cancelled_ = true;
      changed_.notify_all();
    }
    _exit(0);  // the server is gone
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<bool> cancelled_ = false;
  bool granted_ = false;
  std::thread thread_;
};

// Reports go up; when nobody takes them any more, there is nothing left to do.
void tell(const wire::Report& report) {
  if (!write_message(STDOUT_FILENO, report)) _exit(0);
}

JobOrder order_of(wire::Order& order) {
  return {order.job_id(), std::move(*order.mutable_request()), order.threads(), {}, {}, 0, order.memory_budget_bytes()};
}

void mesh(wire::Order& order, Orders& orders, const MesherDoor& mesher) {
  BlobInfo surface;
  surface.id = order.request().surface().blob_id();
  surface.size = order.surface_bytes();
  const Durability durability = order.results_outlive_power_loss() ? Durability::PowerLoss : Durability::Process;
  const auto blobs = make_staged_blobs(surface, order.surface_path(), order.staging_folder(), durability);
  const MemoryGate gate = [&](const Estimate& estimate) {
    wire::Report report;
    *report.mutable_estimate() = to_wire(estimate);
    tell(report);
    orders.wait_for_grant();
  };
  const EventSink sink = [&](v1::WatchJobResponse event) {
    wire::Report report;
    *report.mutable_event() = std::move(event);
    tell(report);
  };
  wire::Report report;
  *report.mutable_result()->mutable_job() = run_mesh_job(order_of(order), *blobs, mesher, orders.cancelled(), gate, sink);
  tell(report);
}

std::vector<char> bytes_of(const wire::Check& check) {
  if (check.surface().has_data()) return {check.surface().data().begin(), check.surface().data().end()};
  std::vector<char> bytes(static_cast<std::size_t>(check.surface_bytes()));
  if (open_file(check.surface_path())->read(0, bytes) != bytes.size())
    throw Refusal(Refused::DataLoss, "BLOB_TRUNCATED", "the stored surface is shorter than it was");
  return bytes;
}

void look(wire::Check& check, const Orders& orders, const MesherDoor& mesher) {
  const CheckOrder order{check.surface(), std::move(*check.mutable_spec()), check.threads(),
                         check.cost_only() ? CheckDepth::Cost : CheckDepth::All};
  Checked checked = run_check(order, [&] { return bytes_of(check); }, check.memory_budget_bytes(), mesher, orders.cancelled());
  wire::Report report;
  *report.mutable_checked()->mutable_report() = std::move(checked.report);
  if (checked.error) *report.mutable_checked()->mutable_error() = std::move(*checked.error);
  tell(report);
}

}  // namespace

bool is_worker(int argc, const char* const* argv) { return argc == 3 && std::string(argv[1]) == kWorkerFlag; }

int worker_main(const MesherDoor& mesher, const char* const* argv) {
  if (!settle(static_cast<pid_t>(std::atoi(argv[2])))) return 1;
  wire::Command command;
  if (!read_message(STDIN_FILENO, command)) return 1;
  if (!command.has_order() && !command.has_check()) return 1;
  limit_memory(command.has_order() ? command.order().memory_limit_bytes() : command.check().memory_limit_bytes());
  // The server looks from here on; static, because its thread listens until the process ends.
  static Orders orders(STDIN_FILENO);
  if (command.has_order()) mesh(*command.mutable_order(), orders, mesher);
  else look(*command.mutable_check(), orders, mesher);
  return 0;
}

}  // namespace strata::server
