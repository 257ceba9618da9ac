#include "core/base/stage.h"

namespace strata {

std::string_view stage_name(Stage stage) {
  switch (stage) {
    case Stage::Read: return "read";
    case Stage::Condition: return "condition";
    case Stage::DetectFeatures: return "detect_features";
    case Stage::MakeSizeField: return "make_size_field";
    case Stage::RefineOctree: return "refine_octree";
    case Stage::Dualize: return "dualize";
    case Stage::Carve: return "carve";
    case Stage::WrapSurface: return "wrap_surface";
    case Stage::FitToSmooth: return "fit_to_smooth";
    case Stage::WrapRidges: return "wrap_ridges";
    case Stage::FitToFeatures: return "fit_to_features";
    case Stage::GrowLayers: return "grow_layers";
    case Stage::MeasureQuality: return "measure_quality";
    case Stage::Write: return "write";
  }
  return "unknown";
}

}  // namespace strata
