// Gives new, flat hexes thickness by moving vertices as far as hexes stay positive.
#pragma once

#include <vector>

#include "core/mesh/hex_mesh.h"

namespace strata {

struct Push {
  VertexId vertex;
  Vec3 by;
};

// The direction whose smallest dot product with the given unit normals is largest (the visible direction); the mean normal where no
// direction sees them all. Unit length, or zero when the normals cancel.
Vec3 visible_direction(const std::vector<Vec3>& normals);

// Moves every vertex by its push, halved (at most to an eighth) as often as a hex round it is not positive. Hexes that stay
// bad are left to the optimiser. Each vertex at most once in `pushes`. Deterministic.
void push_where_positive(HexMesh& mesh, const std::vector<Push>& pushes);

}  // namespace strata
