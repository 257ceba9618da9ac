// A few hexes of a mesh, to work on alone.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/parallel.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// The hexes whose corners are `wanted`, ascending.
template <class Wanted>
std::vector<HexId> hexes_where(const HexMesh& mesh, const Wanted& wanted) {
  std::vector<std::uint8_t> is_wanted(mesh.hexes.size(), 0);
  parallel_for(is_wanted.size(), [&](std::size_t h) { is_wanted[h] = wanted(corners_of(mesh, HexId(h))) ? 1 : 0; });
  std::vector<HexId> result;
  for (std::size_t h = 0; h < is_wanted.size(); ++h)
    if (is_wanted[h] != 0) result.emplace_back(h);
  return result;
}

// 1 for every vertex of the hexes.
IdMap<VertexId, std::uint8_t> vertices_of(const HexMesh& mesh, const std::vector<HexId>& hexes);

struct MeshPart {
  HexMesh mesh;  // hexes, quads and vertices in the order of the whole; vertices that other hexes share are Hold::Fixed
  IdMap<VertexId, VertexId> whole;  // of each vertex of the part
};

// The hexes within `rings` rings of the vertices marked 1, with the quads whose hexes are all among them.
MeshPart cut_part(const HexMesh& whole, const IdMap<VertexId, std::uint8_t>& marked, int rings);

// Positions and attachments go back, but for vertices that were Fixed. Requires that the part's vertices are those it was cut with.
void put_back(const MeshPart& part, HexMesh& whole);

}  // namespace strata
