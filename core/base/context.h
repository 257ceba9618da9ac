// Who is watching a run: progress, cancellation, adjustments. Never options, never data.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <vector>

#include "core/base/diagnostic.h"
#include "core/base/stage.h"

namespace strata {

struct Progress {
  Stage stage = Stage::Read;
  double stage_fraction = 0;  // 0..1 within the stage
  std::int64_t cells = 0;     // hexes known so far; 0 before the dual mesh exists
};

struct StageRecord {
  Stage stage = Stage::Read;
  double seconds = 0;              // wall time
  double cpu_seconds = 0;          // of the process during the stage
  std::int64_t peak_rss_bytes = 0; // of the process at the end of the stage
};

class Context {
 public:
  using ProgressSink = std::function<void(const Progress&)>;
  using AdjustmentSink = std::function<void(const Diagnostic&)>;

  Context() = default;
  // `cancel` may be null; it is read from worker threads and must outlive the context. Sinks are called from the
  // thread that runs the pipeline.
  Context(const std::atomic<bool>* cancel, ProgressSink on_progress, AdjustmentSink on_adjustment = {});

  // Starts a stage (ending the one before) and reports fraction 0. Throws MeshError(Cancelled) when cancelled.
  void begin(Stage stage);
  // Ends the current stage and closes its record.
  void end();
  // Reports progress inside the stage, never less than before; a checkpoint too. Call from the pipeline's thread.
  void progress(double stage_fraction, std::int64_t cells = 0);
  // Throws MeshError(Cancelled) when the run was cancelled. Cheap; callable from any thread.
  void checkpoint() const;
  // Non-throwing form for long parallel loops.
  [[nodiscard]] bool cancelled() const { return cancel_ != nullptr && cancel_->load(std::memory_order_relaxed); }

  // Records that the mesh will differ from the wish. From the pipeline's thread only.
  void adjusted(Diagnostic diagnostic);

  // From here on adjustments are kept back, not told: they belong to an attempt that may come to nothing.
  void hold_adjustments() { holding_ = true; }
  // Those kept back, which are forgotten here; later ones are told again.
  std::vector<Diagnostic> take_held_adjustments();

  [[nodiscard]] const std::vector<Diagnostic>& adjustments() const { return adjustments_; }
  [[nodiscard]] const std::vector<StageRecord>& stages() const { return stages_; }

 private:
  const std::atomic<bool>* cancel_ = nullptr;
  ProgressSink on_progress_;
  AdjustmentSink on_adjustment_;
  Progress last_;
  bool open_ = false;
  std::chrono::steady_clock::time_point started_;
  double cpu_started_ = 0;
  std::vector<Diagnostic> adjustments_, held_;
  bool holding_ = false;
  std::vector<StageRecord> stages_;
};

}  // namespace strata
