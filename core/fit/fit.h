// From a wrapped staircase to the surface: first as if it were smooth, then with its features.
#pragma once

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

struct FitResult {
  HexMesh mesh;
  std::int64_t relaxed = 0;       // boundary vertices left off the surface to stay valid
  std::int64_t softened = 0;      // curves that no edge path represents
};

// Boundary vertices go to the closest point of the surface, features ignored, interior vertices follow. All hexes valid after, or
// as many as could be (the caller checks).
FitResult fit_to_smooth(HexMesh mesh, const Ground& ground, Context& context);

// Labels every quad with chart and patch, matches corners to vertices and curves to edge paths, sets attachments.
FitResult match_features(HexMesh mesh, const Ground& ground, Context& context);

// Moves held vertices onto their corners, curves and charts; interior follows; worst-first polish.
FitResult fit_to_features(HexMesh mesh, const Ground& ground, Context& context);

}  // namespace strata
