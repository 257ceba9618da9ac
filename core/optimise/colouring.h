// Vertices in classes that may move at the same time: no two vertices of a hex share a colour.
#pragma once

#include <vector>

#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// Greedy in id order; only the given vertices are coloured. Within a colour ids ascend. About 8 to 14 colours on dual meshes.
std::vector<std::vector<VertexId>> colour_vertices(const HexMesh& mesh, const VertexStars<HexId>& star,
                                                   const IdMap<VertexId, std::uint8_t>& chosen);

}  // namespace strata
