// The wall round a corner, and what the hexes there will be worth for one or another choice of groups.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/vec3.h"
#include "core/layers/facets.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// Facets round a vertex in the order they turn about the inside; spoke[i] is the edge between facet i and the next.
struct CornerFan {
  VertexId vertex;
  std::vector<FacetIndex> facet;
  std::vector<Vec3> normal;           // into the volume, unit
  std::vector<Vec3> spoke;            // unit
  std::vector<std::uint8_t> crease;   // of each spoke: the charts on its sides differ
};

// Of all vertices that are held by corners; one for each side of the surface that hexes are on.
std::vector<CornerFan> corner_fans(const HexMesh& mesh, const JoinedFacets& facets);

// Estimates the smallest scaled Jacobian at the corner once the layers are in: `group` of each facet, all with layers. Where groups cross, the
// edges of the hex there are those the groups meet at, and the columns that slide on the other group's surface (dossier 7.3: g, gh, ghk).
// Words of more runs are not judged: 1.
double corner_quality(const CornerFan& fan, const std::vector<std::int32_t>& group);

// Of the groups round the corner those that are best joined into one, any two or all of them; none, where that gains nothing.
std::vector<std::int32_t> better_joined(const CornerFan& fan, const std::vector<std::int32_t>& group);

}  // namespace strata
