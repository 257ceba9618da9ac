// The stages of the pipeline, in order. These are the names users see in progress events, logs and reports.
#pragma once

#include <string_view>

namespace strata {

enum class Stage {
  Read,
  Condition,
  DetectFeatures,
  MakeSizeField,
  RefineOctree,
  Dualize,
  Carve,
  WrapSurface,
  FitToSmooth,
  WrapRidges,
  FitToFeatures,
  GrowLayers,
  MeasureQuality,
  Write,
};
inline constexpr int kStageCount = 14;

// "fit_to_features" for Stage::FitToFeatures.
std::string_view stage_name(Stage stage);

}  // namespace strata
