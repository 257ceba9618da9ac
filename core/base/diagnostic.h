// What happened and where: carried by errors (MeshError) and by adjustments (the mesh differs from the wish).
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/vec3.h"

namespace strata {

// Machine-readable causes. Names are stable: they travel to clients as UPPER_SNAKE strings (reason_name).
enum class Reason {
  // input
  FileMalformed,
  FileTooLarge,
  FormatUnknown,
  SurfaceEmpty,
  SurfaceNonFinite,
  SurfaceIndexOutOfRange,
  SurfaceNotClosed,
  SurfaceNonManifold,
  SurfaceDegenerateTriangles,
  SurfaceDuplicateTriangles,
  SurfaceInconsistentOrientation,
  SurfaceSelfIntersection,
  SurfaceSheetDropped,
  SurfaceExtentUnusable,
  SpecInvalid,
  PatchUnknown,
  PatchInTwoLayerEntries,
  RegionNotFound,
  RegionTooThin,      // for the cells
  // limits
  CellBudgetExceeded,
  MemoryBudgetExceeded,
  TimeBudgetExceeded,
  // where the mesh differs from the wish
  SizeCoarsened,
  SizeRefined,
  FeatureSoftened,
  RidgeFilleted,
  SurfaceFitRelaxed,
  TopologyChanged,
  LayersThinned,
  LayersFewer,
  LayersDropped,
  EndingChanged,
  QualityBelowGoal,
  // ours
  Cancelled,
  InvariantViolated,
};
// "SURFACE_NOT_CLOSED" for Reason::SurfaceNotClosed.
std::string_view reason_name(Reason reason);

enum class Severity { Info, Warning, Error };

struct Diagnostic {
  Reason reason = Reason::InvariantViolated;
  Severity severity = Severity::Error;
  std::string message;                    // one or two short sentences: what is wrong, where, what to do
  std::string patch;                      // name of the patch concerned; empty: none
  std::string field;                      // path in the specification, such as "layers[2].growth"; empty: none
  std::vector<std::int64_t> triangles;    // input triangles concerned (0-based, as read); at most kMaxListed
  std::int64_t count = 0;                 // how many in all, when more than listed
  Box box;                                // where, in input units; empty: everywhere or unknown
  std::vector<std::pair<std::string, double>> values;  // every number used in the message, by name

  static constexpr std::size_t kMaxListed = 20;
};

// Who is to blame decides what a service answers.
enum class Failure { InvalidInput, LimitExceeded, Cancelled, Internal };

class MeshError : public std::runtime_error {
 public:
  MeshError(Failure failure, Diagnostic diagnostic)
      : std::runtime_error(diagnostic.message), failure_(failure), diagnostic_(std::move(diagnostic)) {}
  [[nodiscard]] Failure failure() const { return failure_; }
  [[nodiscard]] const Diagnostic& diagnostic() const { return diagnostic_; }

 private:
  Failure failure_;
  Diagnostic diagnostic_;
};

}  // namespace strata
