#include "server/progress_meter.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "server/convert.h"

namespace strata::server {
namespace {

constexpr std::chrono::milliseconds kMinInterval{100};  // 10 Hz: what an eye follows
constexpr double kSilentFraction = 0.05;                // no guess of the time to go before

// Typical shares of the wall time, in the order of Stage.
constexpr std::array<double, kStageCount> kWeights = {1, 3, 2, 4, 8, 5, 5, 3, 14, 3, 20, 22, 4, 6};

}  // namespace

double overall_fraction(Stage stage, double stage_fraction) {
  const auto at = kWeights.begin() + static_cast<std::ptrdiff_t>(stage);
  const double before = std::accumulate(kWeights.begin(), at, 0.0);
  const double all = std::accumulate(kWeights.begin(), kWeights.end(), 0.0);
  return (before + *at * std::clamp(stage_fraction, 0.0, 1.0)) / all;
}

void ProgressMeter::report(const Progress& progress, const std::vector<StageRecord>& ended) {
  report_ended(ended);
  const Clock::time_point now = Clock::now();
  const v1::Stage stage = to_wire(progress.stage);
  if (stage == last_.stage() && now - sent_ < kMinInterval) return;
  sent_ = now;
  const double elapsed = std::chrono::duration<double>(now - started_).count();
  const double fraction = std::max(last_.fraction(), overall_fraction(progress.stage, progress.stage_fraction));
  last_.set_stage(stage);
  last_.set_stage_fraction(progress.stage_fraction);
  last_.set_fraction(fraction);
  last_.set_elapsed_seconds(elapsed);
  last_.set_cells(progress.cells);
  if (fraction > kSilentFraction) last_.set_eta_seconds(elapsed * (1 - fraction) / fraction);
  v1::WatchJobResponse event;
  *event.mutable_progress() = last_;
  sink_(std::move(event));
}

void ProgressMeter::report_ended(const std::vector<StageRecord>& ended) {
  for (; ended_reported_ < ended.size(); ++ended_reported_) {
    v1::WatchJobResponse event;
    *event.mutable_stage_ended() = to_wire(ended[ended_reported_]);
    sink_(std::move(event));
  }
}

}  // namespace strata::server
