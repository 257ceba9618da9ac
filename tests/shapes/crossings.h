// Pairs of triangles that pass through each other.
#pragma once

#include <utility>
#include <vector>

#include "bench/shapes/patched_surface.h"

namespace strata::shapes {

// All pairs, lower triangle first, that cross; of triangles with a shared point, those that meet elsewhere too; of triangles with a shared
// edge, those folded onto each other. Flat triangles in one plane are not seen.
std::vector<std::pair<int, int>> crossings(const PatchedSurface& surface);

}  // namespace strata::shapes
