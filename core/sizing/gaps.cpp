#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/parallel.h"
#include "core/sizing/curvature.h"
#include "core/surface/locator.h"

namespace strata {
namespace {

// Rays along the normal and on a cone around it; the median of their lengths is the width (shape diameter function, Shapira,
// Shamir and Cohen-Or 2008, who use 60 degrees; 30 keeps to the wall opposite).
constexpr int kConeRays = 4;
constexpr std::size_t kLeastHits = 2;                // in a corner of a plate the other rays meet its side walls
constexpr double kConeTangent = 0.5773502691896257;  // of 30 degrees
// A hit counts only on a face that looks back: normals against each other by more than 120 degrees. Faces that meet in a ridge at
// less than 60 degrees share it; cells there are the ridge's business.
constexpr double kFacing = -0.5;
constexpr double kStart = 1e-7;        // rays start this far off the surface: beyond rounding, below any gap that can be meshed
constexpr double kReach = 0.5;         // wider gaps than this part of the box ask for nothing useful

double median_width(const Surface& surface, const Features& features, const Locator& locator,
                    const IdMap<TriangleId, std::array<ChartId, 3>>& beside, TriangleId t, double side) {
  const auto [a, b, c] = surface.corners(t);
  const Vec3 centre = (a + b + c) / 3;
  const Vec3 normal = side * surface.normal[t];
  const Vec3 u = (b - a).normalized(), v = normal.cross(u);
  std::array<double, kConeRays + 1> widths;
  std::size_t found = 0;
  for (int i = 0; i <= kConeRays; ++i) {
    Vec3 d = normal;
    if (i > 0) {
      const double around = 2 * 3.141592653589793 * i / kConeRays;
      d += kConeTangent * (std::cos(around) * u + std::sin(around) * v);
    }
    const auto hit = locator.first_hit(centre + kStart * normal, d, kReach);
    if (!hit) continue;
    const TriangleId h = hit->triangle;
    if (surface.normal[t].dot(surface.normal[h]) > kFacing) continue;
    // Charts that share a curve near by: the corner between them narrows to nothing by itself.
    const auto& near = beside[t];
    if (features.chart[h] != features.chart[t] && std::find(near.begin(), near.end(), features.chart[h]) != near.end()) continue;
    widths[found++] = hit->s;  // along the normal, as d has a unit part of it
  }
  if (found < kLeastHits) return std::numeric_limits<double>::infinity();
  std::nth_element(widths.begin(), widths.begin() + found / 2, widths.begin() + found);
  return widths[found / 2];
}

}  // namespace

IdMap<TriangleId, double> size_by_gaps(const Surface& surface, const Features& features, double cells) {
  const std::size_t count = surface.triangles.size();
  const Locator locator(surface);
  // Charts met across the triangle's own edges, or its neighbours': a shared ridge within about a triangle.
  IdMap<TriangleId, std::array<ChartId, 3>> beside(count);
  parallel_for(count, [&](std::size_t index) {
    const TriangleId t(index);
    for (std::size_t i = 0; i < 3; ++i) {
      const TriangleId n = surface.neighbours[t][i];
      if (!n.valid()) continue;
      beside[t][i] = features.chart[n];
      if (features.chart[n] != features.chart[t]) continue;
      for (const TriangleId m : surface.neighbours[n])
        if (m.valid() && features.chart[m] != features.chart[t]) beside[t][i] = features.chart[m];
    }
  });
  IdMap<TriangleId, double> size(count, std::numeric_limits<double>::infinity());
  parallel_for(
      count,
      [&](std::size_t index) {
        const TriangleId t(index);
        const double width =
            std::min(median_width(surface, features, locator, beside, t, 1), median_width(surface, features, locator, beside, t, -1));
        size[t] = width / cells;
      },
      256);
  return size;
}

}  // namespace strata
