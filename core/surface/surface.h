// The conditioned input surface: welded, oriented, finite. Only `condition` makes one.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/base/vec3.h"
#include "core/surface/triangle_soup.h"

namespace strata {

class Context;

// The working frame: x_work = (x_input - origin) * scale, scale a power of two, so the way back is exact to one rounding.
// In the working frame the surface's bounding box is centred on 0 and its longest side lies in (0.5, 1].
struct Frame {
  Vec3 origin = Vec3::Zero();
  double scale = 1;
  [[nodiscard]] Vec3 to_work(const Vec3& p) const { return (p - origin) * scale; }
  [[nodiscard]] Vec3 to_input(const Vec3& p) const { return p / scale + origin; }
};

using TrianglePoints = std::array<PointId, 3>;
using EdgeNeighbours = std::array<TriangleId, 3>;

// Read-only after conditioning. All geometry is in the working frame.
class Surface {
 public:
  IdMap<PointId, Vec3> points;
  IdMap<TriangleId, TrianglePoints> triangles;     // consistently oriented per component; outer shells point outwards
  IdMap<TriangleId, PatchId> patch;
  IdMap<PatchId, std::string> patch_names;
  IdMap<TriangleId, Vec3> normal;                  // unit
  // Neighbour across edge i = (corner i, corner i+1); invalid where the edge is open or has more than two triangles.
  IdMap<TriangleId, EdgeNeighbours> neighbours;
  IdMap<TriangleId, std::int32_t> component;       // connected through shared edges
  IdMap<TriangleId, std::int64_t> source;          // index of the triangle as read
  std::int32_t component_count = 0;
  bool closed = false;                             // no open edge anywhere
  Box box;
  Frame frame;

  [[nodiscard]] std::array<Vec3, 3> corners(TriangleId t) const {
    const TrianglePoints& p = triangles[t];
    return {points[p[0]], points[p[1]], points[p[2]]};
  }

 private:
  Surface() = default;
  friend Surface condition(TriangleSoup soup, Context& context);
  friend Surface part_of(const Surface& surface, const IdMap<TriangleId, std::uint8_t>& keep);
};

// The triangles marked 1, in the same frame and with the same patches; edges to those left out are open. Requires one triangle at least.
Surface part_of(const Surface& surface, const IdMap<TriangleId, std::uint8_t>& keep);

// Welds, drops degenerate and duplicate triangles, orients, moves to the working frame. Repairs are reported as adjustments.
// Throws MeshError(InvalidInput): SurfaceEmpty, SurfaceNonFinite, SurfaceExtentUnusable.
Surface condition(TriangleSoup soup, Context& context);

}  // namespace strata
