// The conditioned input surface: welded, oriented, finite. Only `condition` makes one.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/base/vec3.h"
#include "core/surface/triangle_soup.h"

namespace strata {

class Context;

// The working frame: x_work = turn (x_input - origin) scale, scale a power of two. Without a turn the way back is exact to one rounding, the
// surface's bounding box is centred on 0 and its longest side lies in (0.5, 1].
struct Frame {
  Vec3 origin = Vec3::Zero();
  double scale = 1;
  std::optional<Mat3> turn;  // rows are the axes of the working frame; empty: those of the input
  [[nodiscard]] Vec3 to_work(const Vec3& p) const {
    const Vec3 q = (p - origin) * scale;
    return turn ? Vec3(*turn * q) : q;
  }
  [[nodiscard]] Vec3 to_input(const Vec3& p) const { return (turn ? Vec3(turn->transpose() * p) : p) / scale + origin; }
  // The smallest box that holds the box, turned back.
  [[nodiscard]] Box to_input(const Box& box) const {
    Box out;
    if (box.empty()) return out;
    for (int i = 0; i < 8; ++i)
      out.add(to_input(Vec3((i & 1 ? box.max : box.min).x(), (i & 2 ? box.max : box.min).y(), (i & 4 ? box.max : box.min).z())));
    return out;
  }
};

using TrianglePoints = std::array<PointId, 3>;
using EdgeNeighbours = std::array<TriangleId, 3>;

// Read-only after conditioning. All geometry is in the working frame.
class Surface {
 public:
  IdMap<PointId, Vec3> points;
  IdMap<TriangleId, TrianglePoints> triangles;  // consistently oriented per component; outer shells point outwards
  IdMap<TriangleId, PatchId> patch;
  IdMap<PatchId, std::string> patch_names;
  IdMap<TriangleId, Vec3> normal;  // unit
  // Neighbour across edge i = (corner i, corner i+1); invalid where the edge is open or has more than two triangles.
  IdMap<TriangleId, EdgeNeighbours> neighbours;
  IdMap<TriangleId, std::int32_t> component;  // connected through shared edges
  IdMap<TriangleId, std::int64_t> source;  // index of the triangle as read
  std::int32_t component_count = 0;
  bool closed = false;  // no open edge anywhere
  Box box;
  double longest_side = 0;  // of the box round the surface as it was read, in units of the working frame
  Frame frame;

  [[nodiscard]] std::array<Vec3, 3> corners(TriangleId t) const {
    const TrianglePoints& p = triangles[t];
    return {points[p[0]], points[p[1]], points[p[2]]};
  }

 private:
  Surface() = default;
  friend Surface condition(TriangleSoup soup, Context& context);
  friend Surface part_of(const Surface& surface, const IdMap<TriangleId, std::uint8_t>& keep);
  friend Surface turned(Surface surface, const Mat3& axes);
};

// The triangles marked 1, in the same frame and with the same patches; edges to those left out are open. Requires one triangle at least.
Surface part_of(const Surface& surface, const IdMap<TriangleId, std::uint8_t>& keep);

// Welds, drops degenerate and duplicate triangles, orients, moves to the working frame. Repairs are reported as adjustments.
// Throws MeshError(InvalidInput): SurfaceEmpty, SurfaceNonFinite, SurfaceExtentUnusable.
Surface condition(TriangleSoup soup, Context& context);

}  // namespace strata
