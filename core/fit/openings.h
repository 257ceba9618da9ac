// Openings of the surface: the winding number closes them, so the mesh has a skin there, but nothing for it to stand on.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

// 1 for boundary vertices over an opening of `whole`: what is closest of it is an open edge, and they stand beyond that by more than half the
// local edge, or there is no surface across the skin. The ground's surface is `whole` or a part of it. Sized like the vertices; all 0 where
// `whole` is closed. Deterministic.
IdMap<VertexId, std::uint8_t> vertices_over_openings(const HexMesh& mesh, const Ground& ground, const Surface& whole);

// Triangles with an edge that no other triangle has, ascending by their edges' points; one may come more than once.
std::vector<TriangleId> triangles_at_openings(const Surface& surface);

}  // namespace strata
