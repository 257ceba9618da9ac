// The wall under a group: its facets, and at each column's foot the direction, the size and the heights wanted there.
#pragma once

#include <array>
#include <vector>

#include "core/layers/columns.h"
#include "core/layers/facets.h"
#include "core/layers/plan.h"
#include "core/layers/size_law.h"
#include "core/optimise/ground.h"
#include "core/surface/locator.h"

namespace strata {

// Facets of the group as the mesh is now, ascending; `widened` (by quad, may be shorter) adds bare quads to a group, or takes kLeftBare out
// of all.
inline constexpr std::int32_t kLeftBare = -2;
std::vector<FacetIndex> wall_of_group(const HexMesh& mesh, const LayerPlan& plan, std::int32_t group,
                                      const std::vector<std::int32_t>& widened);

// Into the volume, at the corner of the facet that is vertex i of the quad; unit, or zero where the corner is flat.
Vec3 inward_normal(const HexMesh& mesh, FacetIndex facet, std::size_t corner);

// The direction from which all the normals are seen best: maximises the smallest dot product (Kallinderis and Ward 1993, visibility).
Vec3 most_visible(const std::vector<Vec3>& normals);

// At each column's foot.
struct Foot {
  Vec3 direction = Vec3::Zero();  // unit; along the surface where the column's top is held there
  Vec3 normal = Vec3::Zero();  // mean of the unit normals round it, not unit itself: a column's height is its part along this
  double own_sense = -1;  // whether the direction goes with (1) or against (-1) the normal of the surface under it
  double stretch = 1;  // column length over height normal to the wall
  double size = 0;  // mean edge length of the wall there
  FrontIndex front = kNoFront;  // one of the fronts it stands on
  double first_height = 0;  // wished, working frame
  double growth = 1;
};
std::vector<Foot> feet_of(const HexMesh& mesh, const std::vector<FacetIndex>& wall, const Columns& columns, const Ground& ground,
                          const std::vector<LayerSpec>& entries, const IdMap<PatchId, PatchWish>& wishes);

// What counts as room.
struct RoomRules {
  // Along a bare wall that columns slide on. Not measured: columns of a few sizes find its end as they grow. Measured: a share of the way to
  // its far end, since thick columns would drive all its quads against that.
  bool along_walls = false;
  IdMap<PatchId, double> gap_share;  // of the way to an opposite wall, by that wall's patch
};
// For each foot the thickness (normal to the wall) that there is room for: a share of the gap in front of the wall, as far as the laws ask.
std::vector<double> room_at(const HexMesh& mesh, const Columns& columns, const std::vector<Foot>& feet, const std::vector<ColumnLaw>& laws,
                            const Ground& ground, const Locator& locator, const RoomRules& rules);

// Pairs of columns that an edge of the wall joins, once each.
std::vector<std::array<std::int32_t, 2>> columns_beside(const HexMesh& mesh, const std::vector<FacetIndex>& wall, const Columns& columns);
// Lowers thicknesses so that they change by no more than `slope` per unit length along the wall.
void grade(const HexMesh& mesh, const Columns& columns, const std::vector<std::array<std::int32_t, 2>>& beside, double slope,
           std::vector<double>& thickness);

// In a concave edge that one sheet covers, the columns on the edge lean away from either wall, over the next columns when they are thick.
// Lets the columns beside lean along with them, less and less; their heights stay.
void lean_with_edges(const HexMesh& mesh, const Columns& columns, const std::vector<std::array<std::int32_t, 2>>& beside,
                     const std::vector<double>& thickness, std::vector<Foot>& feet);

}  // namespace strata
