// The wall as the layers see it: facets (a quad seen from one of its hexes), who is next to whom, and at what angle.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

enum class FacetSide : std::uint8_t { Back, Front };  // of a quad: the hex its normal points out of, or the one it points into

// A front is one side of a chart: what carries layers, or not.
using FrontIndex = std::int32_t;
inline constexpr FrontIndex kNoFront = -1;
inline FrontIndex front_of(ChartId chart, FacetSide side) {
  return chart.valid() ? chart.value * 2 + static_cast<std::int32_t>(side) : kNoFront;
}

// A facet's index: 2 * quad + side.
using FacetIndex = std::int32_t;
inline constexpr FacetIndex kNoFacet = -1;
inline FacetIndex facet_of(QuadId quad, FacetSide side) { return quad.value * 2 + static_cast<std::int32_t>(side); }
inline QuadId quad_of(FacetIndex facet) { return QuadId(facet / 2); }
inline FacetSide side_of(FacetIndex facet) { return static_cast<FacetSide>(facet & 1); }

class Facets {
 public:
  // Quads in `bare` (ascending) belong to no front.
  explicit Facets(const HexMesh& mesh, const std::vector<QuadId>& bare = {});

  [[nodiscard]] std::size_t slots() const { return sides_.size() * 2; }   // facet indices are below; some are empty
  [[nodiscard]] bool exists(FacetIndex facet) const { return hex_face(facet).hex.valid(); }
  [[nodiscard]] FaceNeighbour hex_face(FacetIndex facet) const;           // the hex that sees the quad, and its face
  [[nodiscard]] bool on_interface(FacetIndex facet) const { return sides_[quad_of(facet)].front.valid(); }
  [[nodiscard]] bool is_bare(FacetIndex facet) const { return std::binary_search(bare_.begin(), bare_.end(), quad_of(facet)); }
  [[nodiscard]] FrontIndex front(FacetIndex facet) const {
    return is_bare(facet) ? kNoFront : front_of(mesh_->chart[quad_of(facet)], side_of(facet));
  }
  // Counter-clockwise seen from outside the hex.
  [[nodiscard]] QuadVertices vertices(FacetIndex facet) const;

 protected:
  const HexMesh* mesh_;

 private:
  std::vector<QuadId> bare_;
  IdMap<QuadId, QuadSides> sides_;
};

// Across an edge of a facet, turning through the hexes of its region.
struct FacetNeighbour {
  FacetIndex facet = kNoFacet;
  double angle = 0;   // interior dihedral angle of the mesh there, radians
};

// Facets that know each other; dear for what it needs of all hexes.
class JoinedFacets : public Facets {
 public:
  explicit JoinedFacets(const HexMesh& mesh, const std::vector<QuadId>& bare = {});

  // Across the edge from vertices(facet)[edge] to the next.
  [[nodiscard]] FacetNeighbour neighbour(FacetIndex facet, int edge) const;

 private:
  FaceNeighbours neighbours_;
  IdMap<HexId, std::array<FacetIndex, 6>> facet_at_;
};

// Area vector of a quad by its diagonals; right-hand rule, length = area of a planar quad.
inline Vec3 area_vector(const HexMesh& mesh, const QuadVertices& q) {
  return 0.5 * (mesh.position[q[2]] - mesh.position[q[0]]).cross(mesh.position[q[3]] - mesh.position[q[1]]);
}

}  // namespace strata
