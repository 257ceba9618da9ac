#include "core/fit/routes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "core/base/context.h"
#include "core/features/features.h"
#include "core/surface/surface.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

// A cube's features, and a crease of so many of its triangles' edges, straight, in the middle of a face.
Features with_crease_in_a_face(const Surface& surface, std::size_t edges, Context& context) {
  Features features = detect_features(surface, {}, context);
  const Vec3 from = surface.frame.to_work(Vec3(0.5, 0.5, 1));
  const auto at = [&](const Vec3& p) {
    return *std::min_element(surface.points.ids().begin(), surface.points.ids().end(),
                             [&](PointId a, PointId b) { return (surface.points[a] - p).norm() < (surface.points[b] - p).norm(); });
  };
  const Vec3 edge = surface.frame.to_work(Vec3(0.6, 0.5, 1)) - from;
  Curve crease;
  for (std::size_t i = 0; i <= edges; ++i) crease.points.push_back(at(from + static_cast<double>(i) * edge));
  for (TriangleId t : surface.triangles.ids())
    for (PointId p : surface.triangles[t])
      if (p == crease.points.front()) crease.left = crease.right = features.chart[t];
  crease.length = static_cast<double>(edges) * edge.norm();
  crease.dihedral_mean = crease.dihedral_min = crease.dihedral_max = 0.7 * std::numbers::pi;
  const CurveId id(features.curves.size());
  crease.first = features.corners.push_back({crease.points.front(), {id}, {}});
  crease.last = features.corners.push_back({crease.points.back(), {id}, {}});
  features.curves.push_back(std::move(crease));
  return features;
}

TEST(Routes, ACreaseInTheOpenIsKeptFromAnEdgeOn) {
  Context context;
  const Surface surface = condition(test::cube(10), context);
  for (const std::size_t edges : {1u, 3u}) {
    const Features features = with_crease_in_a_face(surface, edges, context);
    const Ground ground(surface, features);
    const double length = features.curves[CurveId(features.curves.size() - 1)].length;
    const auto keeps_it = [&](double cells) {
      const RoutePlan plan = plan_routes(ground, {}, [&](const Vec3&) { return length / cells; });
      return std::any_of(plan.routes.begin(), plan.routes.end(),
                         [&](const Route& r) { return r.curves == std::vector<CurveId>{CurveId(features.curves.size() - 1)}; });
    };
    EXPECT_TRUE(keeps_it(3));
    EXPECT_TRUE(keeps_it(1)) << "one edge of the mesh can show it";
    EXPECT_FALSE(keeps_it(0.3));
  }
}

}  // namespace
}  // namespace strata
