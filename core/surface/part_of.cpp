#include <algorithm>

#include "core/surface/draft.h"
#include "core/surface/surface.h"

namespace strata {

Surface part_of(const Surface& surface, const IdMap<TriangleId, std::uint8_t>& keep) {
  Surface part;
  part.patch_names = surface.patch_names;
  part.frame = surface.frame;
  part.box = surface.box;
  part.longest_side = surface.longest_side;
  std::vector<PointId> number(surface.points.size());
  for (TriangleId t : surface.triangles.ids()) {
    if (keep[t] == 0) continue;
    TrianglePoints points = surface.triangles[t];
    for (PointId& p : points) {
      PointId& renumbered = number[p.index()];
      if (!renumbered.valid()) renumbered = part.points.push_back(Vec3(surface.points[p]));
      p = renumbered;
    }
    part.triangles.push_back(points);
    part.patch.push_back(PatchId(surface.patch[t]));
    part.normal.push_back(Vec3(surface.normal[t]));
    part.source.push_back(std::int64_t{surface.source[t]});
  }
  connect(part);
  return part;
}

}  // namespace strata
