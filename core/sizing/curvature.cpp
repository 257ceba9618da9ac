#include "core/sizing/curvature.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/parallel.h"

namespace strata {
namespace {

constexpr int kSmoothing = 2;         // rounds of averaging over neighbours: single noisy triangles do not refine
constexpr double kFlatTurn = 1e-3;    // radians from one triangle to the next: flat within the grain of the input

}  // namespace

IdMap<TriangleId, double> size_by_curvature(const Surface& surface, const Features& features, double angle) {
  const std::size_t count = surface.triangles.size();
  // Curvature (1 / R) of a triangle: the largest turn to a neighbour in its chart over the distance of their centroids along the
  // surface. The neighbours' mean turns what is left of tessellation noise into little.
  IdMap<TriangleId, double> curvature(count, 0.0);
  const auto next_to = [&](TriangleId t, std::size_t i) {
    const TriangleId n = surface.neighbours[t][i];
    return n.valid() && features.chart[n] == features.chart[t] ? n : TriangleId();
  };
  const auto centroid = [&](TriangleId t) {
    const auto [a, b, c] = surface.corners(t);
    return Vec3((a + b + c) / 3);
  };
  parallel_for(count, [&](std::size_t index) {
    const TriangleId t(index);
    const auto x = surface.corners(t);
    double sum_turn = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const TriangleId n = next_to(t, i);
      if (!n.valid()) continue;
      const double turn = std::atan2(surface.normal[t].cross(surface.normal[n]).norm(), surface.normal[t].dot(surface.normal[n]));
      if (turn < kFlatTurn) continue;
      // Distance across the edge: the sum of the heights of both centroids over it.
      const Vec3 along = (x[(i + 1) % 3] - x[i]).normalized();
      const auto height = [&](const Vec3& p) { return (p - x[i]).cross(along).norm(); };
      // Half a quad strip is a right triangle: its centroid is a third of the strip away, so sizes there are too small by up to a third.
      const double across = height(centroid(t)) + height(centroid(n));
      if (across > 0) sum_turn = std::max(sum_turn, 2 * std::sin(std::min(turn, 3.0) / 2) / across);
    }
    curvature[t] = sum_turn;
  });
  for (int round = 0; round < kSmoothing; ++round) {
    const IdMap<TriangleId, double> before = curvature;
    parallel_for(count, [&](std::size_t index) {
      const TriangleId t(index);
      double sum = before[t], weight = 1;
      for (std::size_t i = 0; i < 3; ++i)
        if (const TriangleId n = next_to(t, i); n.valid()) {
          sum += before[n];
          weight += 1;
        }
      curvature[t] = sum / weight;
    });
  }
  IdMap<TriangleId, double> size(count, std::numeric_limits<double>::infinity());
  for (const TriangleId t : size.ids())
    if (curvature[t] > 0) size[t] = 2 * std::sin(std::min(angle, 3.0) / 2) / curvature[t];
  return size;
}

}  // namespace strata
