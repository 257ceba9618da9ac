// From the pipeline's progress to the events a watcher sees: overall fraction, time to go, ended stages, at most 10 Hz.
#pragma once

#include <chrono>
#include <functional>

#include "core/base/context.h"
#include "strata/v1/job.pb.h"

namespace strata::server {

class ProgressMeter {
 public:
  using Sink = std::function<void(v1::WatchJobResponse)>;

  explicit ProgressMeter(Sink sink) : sink_(std::move(sink)), started_(Clock::now()) {}

  // `ended` is Context::stages(): whatever is new there becomes a stage_ended event.
  void report(const Progress& progress, const std::vector<StageRecord>& ended);
  void report_ended(const std::vector<StageRecord>& ended);
  [[nodiscard]] v1::Stage stage() const { return last_.stage(); }

 private:
  using Clock = std::chrono::steady_clock;

  Sink sink_;
  Clock::time_point started_, sent_;
  v1::Progress last_;
  std::size_t ended_reported_ = 0;
};

// Share of the whole run that lies before this point, 0..1. Stage weights from recorded runs.
double overall_fraction(Stage stage, double stage_fraction);

}  // namespace strata::server
