// What people see while a job runs, on standard error.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "strata/v1/job.pb.h"

namespace strata::client {

// A block of three lines, redrawn at most ten times a second, on a terminal; one line a stage elsewhere.
class ProgressView {
 public:
  enum class Style { Silent, Lines, Block };
  explicit ProgressView(Style style) : style_(style) {}
  ~ProgressView() { clear(); }
  ProgressView(const ProgressView&) = delete;
  ProgressView& operator=(const ProgressView&) = delete;

  // Lines where standard error is no terminal, a block where it is.
  static Style style_for(bool quiet, bool no_progress);

  void transfer(const std::string& what, std::int64_t done, std::int64_t total);
  void state(v1::JobState state, int queue_position);
  void progress(const v1::Progress& progress);
  void estimate(const v1::Estimate& estimate);
  void tried_again(int attempt);
  void stage_ended(const v1::StageRecord& record);
  void quality(const v1::Quality& quality);
  void adjustment(const v1::Diagnostic& diagnostic);
  // Removes the block.
  void clear();

 private:
  void draw(bool force);
  Style style_;
  std::string headline_, bar_, quality_;
  std::int64_t cells_ = 0, expected_ = 0;
  int notes_ = 0;
  int drawn_ = 0;
  std::chrono::steady_clock::time_point last_{};
};

// "fit_to_features" for STAGE_FIT_TO_FEATURES; "layers_thinned", "succeeded", "vtu" likewise.
std::string lower_name(const std::string& enum_name, const std::string& prefix);
std::string stage_name(v1::Stage stage);
std::string rung_name(v1::Rung rung);
std::string state_name(v1::JobState state);

}  // namespace strata::client
