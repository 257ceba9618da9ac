// The guarantee behind clean_skin: whatever it was given, the buffer layer can be inserted afterwards.
#pragma once

#include "core/carve/clean_skin.h"
#include "core/mesh/adjacency.h"

namespace strata {

// Takes hexes out of their regions until, round every vertex and for every region there, the region's hexes are one face-connected fan,
// all others are one, and those of the others that are kept are at most one: what wrap_surface asks for. A hex goes to a neighbour's region
// at most twice and then to the void for good, so it ends. Returns whether anything changed. Deterministic.
bool part_pinches(const HexMesh& mesh, const VertexStars<HexId>& star, const FaceNeighbours& neighbours, IdMap<HexId, std::int32_t>& label);

}  // namespace strata
