#include "core/base/diagnostic.h"

namespace strata {

std::string_view reason_name(Reason reason) {
  switch (reason) {
    case Reason::FileMalformed: return "FILE_MALFORMED";
    case Reason::FileTooLarge: return "FILE_TOO_LARGE";
    case Reason::FormatUnknown: return "FORMAT_UNKNOWN";
    case Reason::SurfaceEmpty: return "SURFACE_EMPTY";
    case Reason::SurfaceNonFinite: return "SURFACE_NON_FINITE";
    case Reason::SurfaceIndexOutOfRange: return "SURFACE_INDEX_OUT_OF_RANGE";
    case Reason::SurfaceNotClosed: return "SURFACE_NOT_CLOSED";
    case Reason::SurfaceNonManifold: return "SURFACE_NON_MANIFOLD";
    case Reason::SurfaceDegenerateTriangles: return "SURFACE_DEGENERATE_TRIANGLES";
    case Reason::SurfaceDuplicateTriangles: return "SURFACE_DUPLICATE_TRIANGLES";
    case Reason::SurfaceInconsistentOrientation: return "SURFACE_INCONSISTENT_ORIENTATION";
    case Reason::SurfaceSelfIntersection: return "SURFACE_SELF_INTERSECTION";
    case Reason::SurfaceSheetDropped: return "SURFACE_SHEET_DROPPED";
    case Reason::SurfaceExtentUnusable: return "SURFACE_EXTENT_UNUSABLE";
    case Reason::SpecInvalid: return "SPEC_INVALID";
    case Reason::PatchUnknown: return "PATCH_UNKNOWN";
    case Reason::PatchInTwoLayerEntries: return "PATCH_IN_TWO_LAYER_ENTRIES";
    case Reason::RegionNotFound: return "REGION_NOT_FOUND";
    case Reason::RegionTooThin: return "REGION_TOO_THIN";
    case Reason::CellBudgetExceeded: return "CELL_BUDGET_EXCEEDED";
    case Reason::MemoryBudgetExceeded: return "MEMORY_BUDGET_EXCEEDED";
    case Reason::TimeBudgetExceeded: return "TIME_BUDGET_EXCEEDED";
    case Reason::SizeCoarsened: return "SIZE_COARSENED";
    case Reason::SizeRefined: return "SIZE_REFINED";
    case Reason::FeatureSoftened: return "FEATURE_SOFTENED";
    case Reason::RidgeFilleted: return "RIDGE_FILLETED";
    case Reason::SurfaceFitRelaxed: return "SURFACE_FIT_RELAXED";
    case Reason::TopologyChanged: return "TOPOLOGY_CHANGED";
    case Reason::LayersThinned: return "LAYERS_THINNED";
    case Reason::LayersFewer: return "LAYERS_FEWER";
    case Reason::LayersDropped: return "LAYERS_DROPPED";
    case Reason::EndingChanged: return "ENDING_CHANGED";
    case Reason::QualityBelowGoal: return "QUALITY_BELOW_GOAL";
    case Reason::Cancelled: return "CANCELLED";
    case Reason::InvariantViolated: return "INVARIANT_VIOLATED";
  }
  return "UNKNOWN";
}

}  // namespace strata
