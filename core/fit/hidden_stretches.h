// Which parts of the feature curves no edges of a mesh stand on.
#pragma once

#include <vector>

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

struct Stretch {
  double from = 0, to = 0;  // arc lengths from the curve's first point; working frame
};

// By curve, ascending and apart. An edge stands on what lies between its ends, which are held to the curve or its corners; where a path
// goes on along another curve, from its end to that of the curve.
IdMap<CurveId, std::vector<Stretch>> hidden_stretches(const HexMesh& mesh, const Ground& ground);

// The part of a curve between two arc lengths, as a polyline.
std::vector<Vec3> points_along(const Stretch& stretch, const Curve& curve, const Surface& surface);

}  // namespace strata
