// What lies on either side of the surface's triangles: which of them bound meshed regions, and which lie between two.
#pragma once

#include <compare>
#include <cstdint>
#include <vector>

#include "core/base/ids.h"
#include "core/carve/colour.h"
#include "core/surface/surface.h"

namespace strata {

// A node near the surface and the triangle that it sees.
struct Sighting {
  TriangleId triangle;
  std::int32_t front = 0;   // 1: seen from where the normal points to
  std::int32_t colour = kVoid;
  friend auto operator<=>(const Sighting&, const Sighting&) = default;
};

// By the majority of the sightings on either side; triangles that no node sees, or too few to believe that they bound nothing, follow their
// neighbours.
IdMap<TriangleId, Bounds> judge_triangles(const Surface& surface, std::vector<Sighting> sightings);

}  // namespace strata
