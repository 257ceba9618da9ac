// From a fit that did not work out everywhere back towards the mesh it began with, no further than must be.
#pragma once

#include <cstdint>

#include "core/mesh/hex_mesh.h"

namespace strata {

struct Retreat {
  HexMesh mesh;
  std::int64_t moved = 0;  // boundary vertices that went back some of the way
  std::int64_t bad = 0;    // hexes that are not valid; 0 when `start` is valid
};

// `fitted` has the hexes and quads of `start`, its vertices elsewhere. Vertices of hexes that are not valid go back half of their way, again
// and again and in the end all of it, until every hex is valid.
Retreat retreat(const HexMesh& start, HexMesh fitted);

}  // namespace strata
