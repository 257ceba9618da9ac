// Where the skin of a mesh touches itself, though all its hexes may be positive.
#pragma once

#include <compare>
#include <vector>

#include "core/mesh/hex_mesh.h"

namespace strata {

// A boundary vertex and a boundary quad that it lies on without being one of its corners.
struct Contact {
  VertexId vertex;
  QuadId quad;
  friend auto operator<=>(const Contact&, const Contact&) = default;
};

// As a share of a quad's shortest edge: a vertex nearer to the quad than this lies on it. Whoever reads the mesh would take the place for
// a crack or a hanging face.
inline constexpr double kContactShare = 1e-6;

// Every contact of the outer boundary (interfaces between regions have hexes on both sides and are left out), by ascending vertex and quad.
// A quad is four triangles round its centre. About a microsecond a quad; same answer for any thread count.
std::vector<Contact> find_contacts(const HexMesh& mesh, double share = kContactShare);

}  // namespace strata
