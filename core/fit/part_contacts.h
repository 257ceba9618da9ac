// Takes the skin off itself where it touches.
#pragma once

#include <cstdint>

#include "core/mesh/hex_mesh.h"

namespace strata {

struct PartedContacts {
  HexMesh mesh;
  std::int64_t moved = 0;  // vertices that stand off the surface now, by a few hundredths of their edges
  std::int64_t left = 0;   // contacts that remain
};

// Draws the vertices of every contact a little into their own hexes, as far as these stay as good as valid hexes must be.
PartedContacts part_contacts(HexMesh mesh);

}  // namespace strata
