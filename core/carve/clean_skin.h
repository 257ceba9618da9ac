// Makes every region's boundary a 2-manifold by dropping hexes that stick out and filling notches.
#pragma once

#include <cstdint>

#include "core/mesh/hex_mesh.h"

namespace strata {

// Per hex of a mesh: its region, or -1.
struct HexChoice {
  IdMap<HexId, std::int32_t> label;     // region kept for, or kVoid
  IdMap<HexId, std::int32_t> fillable;  // region it may be kept for though too near the surface, or kVoid
  IdMap<HexId, std::uint8_t>
      thin{};  // 1: in or beside a place about as thin as a cell, where hexes are added sooner than dropped; may be empty
};

// After: round every vertex the hexes of a region are one face-connected fan, and so are all others. Bumps and ends of steps are gone,
// thin rods and plates stay (their hexes have four or five boundary faces). Face-connected pieces of fewer than 8 hexes are gone unless
// they are the largest of their region. Every hex changes at most twice. The mesh must hold all hexes round every vertex of a
// kept or fillable hex. Deterministic.
void clean_skin(const HexMesh& mesh, HexChoice& choice);

}  // namespace strata
