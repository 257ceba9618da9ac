// Joins corners that lie at exactly the same place.
#pragma once

#include <vector>

#include "core/base/vec3.h"
#include "core/surface/triangle_soup.h"

namespace strata::io {

// Three corners a triangle, as STL has them. Fills points (in order of first appearance) and triangles. Corners are one point
// when all three coordinates are equal; -0 equals 0. Welding within a tolerance is the work of `condition`.
void weld_exact(const std::vector<Vec3>& corners, TriangleSoup& soup);

}  // namespace strata::io
