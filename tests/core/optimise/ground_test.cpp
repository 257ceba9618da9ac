#include "core/optimise/ground.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/base/context.h"
#include "core/optimise/optimise.h"
#include "core/quality/quality.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

Surface conditioned(TriangleSoup soup) {
  Context context;
  return condition(std::move(soup), context);
}
Features smooth(const Surface& surface) {
  Features features;
  features.chart.assign(surface.triangles.size(), ChartId(0));
  features.patch_of_chart.push_back(PatchId(0));
  return features;
}

// One chart a patch, no curves: enough for grounds of boxes.
Features by_patch(const Surface& surface) {
  Features features;
  for (const TriangleId t : surface.triangles.ids()) features.chart.push_back(ChartId(surface.patch[t].value));
  for (const PatchId p : surface.patch_names.ids()) features.patch_of_chart.push_back(p);
  return features;
}

TEST(Polyline, FindsTheClosestPlaceWhateverTheHint) {
  std::vector<Vec3> points;
  for (int i = 0; i <= 400; ++i) points.emplace_back(std::cos(0.05 * i), std::sin(0.05 * i), 0.01 * i);
  const Polyline line(points);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> in(-2, 4);
  for (int round = 0; round < 200; ++round) {
    const Vec3 p(in(random), in(random), in(random));
    double nearest = 1e300;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const Vec3 d = points[i + 1] - points[i];
      const double t = std::clamp(d.dot(p - points[i]) / d.squaredNorm(), 0.0, 1.0);
      nearest = std::min(nearest, (points[i] + t * d - p).norm());
    }
    const Polyline::Place plain = line.closest(p);
    EXPECT_NEAR(std::sqrt(plain.distance2), nearest, 1e-12);
    for (const std::int32_t hint : {0, 17, 399, 1000}) EXPECT_EQ(line.closest(p, hint).position, plain.position);
  }
}

TEST(Ground, ProjectsByAttachment) {
  const Surface surface = conditioned(test::cube(2));  // in the working frame [-1/2, 1/2]^3
  Features features = by_patch(surface);
  Curve curve;
  for (const PointId p : surface.points.ids())
    if (surface.points[p].y() == -0.5 && surface.points[p].z() == -0.5) curve.points.push_back(p);
  std::sort(curve.points.begin(), curve.points.end(), [&](PointId a, PointId b) { return surface.points[a].x() < surface.points[b].x(); });
  features.curves.push_back(curve);
  Corner corner;
  corner.point = curve.points.front();
  features.corners.push_back(corner);
  const Ground ground(surface, features);
  const Vec3 p(0.1, 0.2, 0.7);
  EXPECT_EQ(ground.project({Hold::Free, -1}, p).position, p);
  EXPECT_EQ(ground.project({Hold::Fixed, -1}, p).position, p);
  EXPECT_LT((ground.project({Hold::Chart, kWholeSurface}, p).position - Vec3(0.1, 0.2, 0.5)).norm(), 1e-15);
  for (const ChartId c : features.patch_of_chart.ids()) {
    const Foothold at = ground.project({Hold::Chart, c.value}, p);
    EXPECT_EQ(surface.patch[TriangleId(at.hint)], PatchId(c.value));
    EXPECT_NEAR(at.direction.norm(), 1, 1e-14);
  }
  const Foothold on_curve = ground.project({Hold::Curve, 0}, p);
  EXPECT_LT((on_curve.position - Vec3(0.1, -0.5, -0.5)).norm(), 1e-15);
  EXPECT_LT((on_curve.direction - Vec3(1, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(ground.project({Hold::Corner, 0}, p).position, Vec3(-0.5, -0.5, -0.5));
}

// Grid of n^3 cells over a ball's inscribed cube, to be drawn onto the sphere. Its corners and edges become flat: only the faces do well.
TEST(Optimise, AGridReachesTheSphereAndStaysValid) {
  const Surface surface = conditioned(test::sphere(4));
  const Features features = smooth(surface);
  const Ground ground(surface, features);
  HexMesh mesh = testing::grid(8, 8, 8);
  for (Vec3& p : mesh.position) p = (p - Vec3(4, 4, 4)) * (0.5 / 4 * 0.62);
  for (const QuadVertices& q : mesh.quads)
    for (const VertexId v : q) mesh.attachment[v] = {Hold::Chart, kWholeSurface};
  OptimiseRequest request;
  request.ground = &ground;
  OptimiseOptions options;
  options.sweeps = 40;
  Context context;
  const OptimiseResult result = optimise(std::move(mesh), request, options, context);
  EXPECT_EQ(testing::count_not_positive_hexes(result.mesh), 0);
  EXPECT_EQ(result.off_ground, 0);
  EXPECT_GT(testing::corner_jacobians(result.mesh).mean, 0.75) << "the edges of the grid become flat";
}

// The boundary of the grid is matched to a rotated cube's sides; edges and corners of the grid are held by nobody but their charts.
TEST(Optimise, HeldVerticesGoToTheSidesOfARotatedCube) {
  const Surface surface = conditioned(test::rotated(test::cube(4), Vec3(1, 2, 3), 0.3));
  const Features features = by_patch(surface);
  const Ground ground(surface, features);
  HexMesh mesh = testing::grid(6, 6, 6);
  // Start 30 % too small, turned the way the cube is but for 0.15 radians.
  const Eigen::AngleAxisd turn(0.15, Vec3(1, 2, 3).normalized());
  const double edge = 0.5 / 1.2;
  for (Vec3& p : mesh.position) p = turn * Vec3((p - Vec3(3, 3, 3)) / 3 * edge * 0.8);
  // side of the grid -> patch of the cube, by normals: 0 z-, 1 z+, 2 y-, 3 y+, 4 x-, 5 x+
  const std::array<const char*, 6> names{"z_min", "z_max", "y_min", "y_max", "x_min", "x_max"};
  std::array<std::int32_t, 6> patch{};
  for (std::size_t s = 0; s < 6; ++s)
    for (const PatchId p : surface.patch_names.ids())
      if (surface.patch_names[p] == names[s]) patch[s] = p.value;
  IdMap<VertexId, int> sides(mesh.position.size(), 0);
  for (const QuadId q : mesh.quads.ids())
    for (const VertexId v : mesh.quads[q]) sides[v] |= 1 << mesh.chart[q].value;
  for (const VertexId v : mesh.position.ids())
    for (int s = 0; s < 6; ++s)
      if (sides[v] == 1 << s) mesh.attachment[v] = {Hold::Chart, patch[static_cast<std::size_t>(s)]};
  OptimiseRequest request;
  request.ground = &ground;
  OptimiseOptions options;
  options.sweeps = 60;
  Context context;
  const OptimiseResult result = optimise(std::move(mesh), request, options, context);
  EXPECT_EQ(testing::count_not_positive_hexes(result.mesh), 0);
  EXPECT_EQ(result.off_ground, 0);
}

}  // namespace
}  // namespace strata
