#include "core/base/context.h"

#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "core/base/memory.h"

namespace strata {
namespace {

double process_cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

std::int64_t process_peak_rss_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::int64_t>(usage.ru_maxrss) * 1024;  // Linux counts in KiB
}

}  // namespace

Context::Context(const std::atomic<bool>* cancel, ProgressSink on_progress, AdjustmentSink on_adjustment)
    : cancel_(cancel), on_progress_(std::move(on_progress)), on_adjustment_(std::move(on_adjustment)) {}

void Context::begin(Stage stage) {
  end();
  return_free_memory();
  checkpoint();
  open_ = true;
  started_ = std::chrono::steady_clock::now();
  cpu_started_ = process_cpu_seconds();
  last_.stage = stage;
  last_.stage_fraction = 0;
  progress(0);
}

void Context::end() {
  if (!open_) return;
  open_ = false;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - started_;
  stages_.push_back({last_.stage, elapsed.count(), process_cpu_seconds() - cpu_started_, process_peak_rss_bytes()});
}

void Context::progress(double stage_fraction, std::int64_t cells) {
  checkpoint();
  // A stage that tries again reports its first steps again: what watchers see only rises.
  last_.stage_fraction = std::max(last_.stage_fraction, std::min(stage_fraction, 1.0));
  if (cells > 0) last_.cells = cells;
  if (on_progress_) on_progress_(last_);
}

void Context::checkpoint() const {
  if (!cancelled()) return;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::Cancelled;
  diagnostic.message = "the run was cancelled";
  throw MeshError(Failure::Cancelled, std::move(diagnostic));
}

void Context::adjusted(Diagnostic diagnostic) {
  if (diagnostic.severity == Severity::Error) diagnostic.severity = Severity::Warning;  // the run goes on
  if (holding_) {
    held_.push_back(std::move(diagnostic));
    return;
  }
  if (on_adjustment_) on_adjustment_(diagnostic);
  adjustments_.push_back(std::move(diagnostic));
}

std::vector<Diagnostic> Context::take_held_adjustments() {
  holding_ = false;
  return std::exchange(held_, {});
}

}  // namespace strata
