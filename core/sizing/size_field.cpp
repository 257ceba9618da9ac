#include "core/sizing/size_field.h"

#include <algorithm>
#include <limits>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/sizing/curvature.h"

namespace strata {

SizeField make_size_field(const Surface& surface, const Features& features, const SizeOptions& options, Context& context) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  SizeField field;
  field.max_size = options.max_size;
  field.min_size = options.min_size;
  field.at_triangle.assign(surface.triangles.size(), kNone);
  const auto lower = [&](const IdMap<TriangleId, double>& wish) {
    parallel_for(wish.size(), [&](std::size_t t) {
      field.at_triangle[TriangleId(t)] = std::min(field.at_triangle[TriangleId(t)], wish[TriangleId(t)]);
    });
  };
  if (options.curvature > 0) lower(size_by_curvature(surface, features, options.curvature));
  context.progress(0.4);
  if (options.gap_cells > 0) lower(size_by_gaps(surface, features, options.gap_cells));
  context.progress(0.9);
  parallel_for(surface.triangles.size(), [&](std::size_t i) {
    const TriangleId t(i);
    const PatchId patch = surface.patch[t];
    double& size = field.at_triangle[t];
    if (patch.index() < options.patch_size.size()) size = std::min(size, options.patch_size[patch]);
    if (size < kNone) size = std::max(size, options.min_size);
  });
  field.sources = options.sources;
  for (SizeSource& source : field.sources) {
    source.size = std::max(source.size, options.min_size);
    if (source.shape != SizeSource::Shape::Box) continue;
    const Vec3 low = source.a.cwiseMin(source.b), high = source.a.cwiseMax(source.b);
    source.a = low;
    source.b = high;
  }
  for (CurveId c : options.curve_size.ids()) {
    const std::vector<PointId>& points = features.curves[c].points;
    if (options.curve_size[c] == kNone) continue;
    const double size = std::max(options.curve_size[c], options.min_size);
    for (std::size_t i = 0; i + 1 < points.size(); ++i)
      field.segments.push_back({surface.points[points[i]], surface.points[points[i + 1]], size});
    if (features.curves[c].closed) field.segments.push_back({surface.points[points.back()], surface.points[points.front()], size});
  }
  field.grid = options.grid;
  for (double& size : field.grid.sizes) size = std::max(size, options.min_size);
  context.progress(1);
  return field;
}

}  // namespace strata
