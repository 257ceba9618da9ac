// What a surface file holds, before anything is known about it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/vec3.h"

namespace strata {

// Plain indices on purpose: nothing is checked yet but that every index is within points (readers guarantee that much,
// and that coordinates are finite). Polygons of more than three corners arrive as fans.
struct TriangleSoup {
  std::vector<Vec3> points;                           // input units
  std::vector<std::array<std::int32_t, 3>> triangles; // indices into points
  std::vector<std::int32_t> patch;                    // per triangle: index into patch_names
  std::vector<std::string> patch_names;               // unique, in order of first appearance; {"surface"} when the file has none
};

}  // namespace strata
