// A few hexes of a mesh, to work on alone.
#pragma once

#include <cstdint>

#include "core/mesh/hex_mesh.h"

namespace strata {

struct MeshPart {
  HexMesh mesh;  // hexes, quads and vertices in the order of the whole; vertices that other hexes share are Hold::Fixed
  IdMap<VertexId, VertexId> whole;  // of each vertex of the part
};

// The hexes within `rings` rings of the vertices marked 1, with the quads whose hexes are all among them.
MeshPart cut_part(const HexMesh& whole, const IdMap<VertexId, std::uint8_t>& marked, int rings);

// Positions and attachments go back, but for vertices that were Fixed. Requires that the part's vertices are those it was cut with.
void put_back(const MeshPart& part, HexMesh& whole);

}  // namespace strata
