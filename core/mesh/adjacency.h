// Adjacency of a hex mesh, built where needed and dropped after.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh/hex.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// Compressed rows: the elements round each vertex, ascending.
template <class Element>
struct VertexStars {
  std::vector<std::int64_t> offset;   // vertex count + 1
  std::vector<Element> elements;
  [[nodiscard]] std::span<const Element> of(VertexId v) const {
    return {elements.data() + offset[v.index()], elements.data() + offset[v.index() + 1]};
  }
};
VertexStars<HexId> hexes_round_vertices(const HexMesh& mesh);
VertexStars<QuadId> quads_round_vertices(const HexMesh& mesh);

// Across each face of each hex: the neighbour, and its face that is shared; invalid at the boundary.
struct FaceNeighbour {
  HexId hex;
  std::int8_t face = -1;
};
using FaceNeighbours = IdMap<HexId, std::array<FaceNeighbour, 6>>;
// Throws MeshError(Internal) when a face has more than two hexes.
FaceNeighbours face_neighbours(const HexMesh& mesh);

// The hex (and its face) behind each quad: the one the quad's normal points out of; for an interface quad also the one in front.
struct QuadSides {
  HexId back;
  std::int8_t back_face = -1;
  HexId front;              // invalid on the outer boundary
  std::int8_t front_face = -1;
};
IdMap<QuadId, QuadSides> quad_sides(const HexMesh& mesh);

// The vertices of a hex's face, outward counter-clockwise.
inline QuadVertices face_vertices(const HexVertices& hex, int face) {
  const auto& f = kHexFaces[static_cast<std::size_t>(face)];
  return {hex[static_cast<std::size_t>(f[0])], hex[static_cast<std::size_t>(f[1])], hex[static_cast<std::size_t>(f[2])],
          hex[static_cast<std::size_t>(f[3])]};
}

}  // namespace strata
