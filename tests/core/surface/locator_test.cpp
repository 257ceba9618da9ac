#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <random>

#include "core/base/context.h"
#include "core/base/triangle_geometry.h"
#include "core/surface/locator.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

Surface conditioned(TriangleSoup soup) {
  Context context;
  return condition(std::move(soup), context);
}

std::vector<Vec3> samples(int count, double reach, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> at(-reach, reach);
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i) {
    const double x = at(random), y = at(random), z = at(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

TEST(Locator, ClosestPointIsTheMinimumOverAllTriangles) {
  for (const TriangleSoup& soup : {test::torus(), test::sphere_in_box(), test::cone(40)}) {
    const Surface s = conditioned(soup);
    const Locator locator(s);
    for (const Vec3& p : samples(200, 0.8, 1)) {
      double best = 1e9;
      TriangleId expected;
      for (const TriangleId t : s.triangles.ids()) {
        const auto [a, b, c] = s.corners(t);
        const double d = (closest_on_triangle(p, a, b, c) - p).squaredNorm();
        if (d < best) {
          best = d;
          expected = t;
        }
      }
      const SurfacePoint found = locator.closest(p);
      EXPECT_EQ(found.triangle, expected);
      EXPECT_DOUBLE_EQ(found.distance, std::sqrt(best));
      EXPECT_NEAR((found.position - p).norm(), found.distance, 1e-15);
    }
  }
}

TEST(Locator, TheAnswerDoesNotDependOnTheHint) {
  const Surface s = conditioned(test::cube(8));
  const Locator locator(s);
  std::mt19937 random(5);
  std::vector<Vec3> points = samples(300, 0.7, 2);
  for (const Vec3& p : s.points) points.push_back(p), points.push_back(1.3 * p);  // equal distances to many triangles
  for (const Vec3& p : points) {
    const SurfacePoint plain = locator.closest(p);
    for (int i = 0; i < 4; ++i) {
      const SurfacePoint hinted = locator.closest(p, std::numeric_limits<double>::infinity(), TriangleId(random() % s.triangles.size()));
      EXPECT_EQ(hinted.triangle, plain.triangle);
      EXPECT_EQ(hinted.position, plain.position);
    }
  }
}

TEST(Locator, NothingIsFoundBeyondTheBound) {
  const Surface s = conditioned(test::cube(4));
  const Locator locator(s);
  EXPECT_FALSE(locator.closest(Vec3(1, 0, 0), 0.49).triangle.valid());
  EXPECT_TRUE(locator.closest(Vec3(1, 0, 0), 0.51).triangle.valid());
}

TEST(Locator, APartKnowsOnlyItsTriangles) {
  const Surface s = conditioned(test::cube(4));
  std::vector<TriangleId> top;
  for (const TriangleId t : s.triangles.ids())
    if (s.patch_names[s.patch[t]] == "z_max") top.push_back(t);
  const Locator locator(s, top);
  for (const Vec3& p : samples(50, 0.4, 3)) EXPECT_NEAR(locator.closest(p, 10, TriangleId(0)).distance, 0.5 - p.z(), 1e-12);
}

TEST(Locator, RaysFromInsideAClosedShellAlwaysHitIt) {
  const Surface s = conditioned(test::rotated(test::cube(6), Vec3(1, 2, 3), 0.5));
  const Locator locator(s);
  std::vector<Vec3> targets = samples(500, 1, 4);
  for (const Vec3& p : s.points) targets.push_back(p);  // through vertices: the hardest
  for (const Vec3& d : targets) {
    const auto hit = locator.first_hit(Vec3::Zero(), d, 1e9);
    ASSERT_TRUE(hit.has_value());
    EXPECT_LT(locator.closest(hit->s * d).distance, 1e-12);
  }
  EXPECT_FALSE(locator.first_hit(Vec3(5, 5, 5), Vec3(1, 0, 0), 1e9).has_value());
  EXPECT_FALSE(locator.first_hit(Vec3::Zero(), Vec3(0.1, 0, 0), 1).has_value());
}

TEST(Locator, RaysAlongTheAxesAreExact) {
  const Surface s = conditioned(test::cube(4));
  const Locator locator(s);
  for (int i = 0; i < 3; ++i)
    for (const double sign : {-2.0, 2.0}) {
      Vec3 d = Vec3::Zero();
      d[i] = sign;
      EXPECT_NEAR(locator.first_hit(Vec3(0.01, 0.02, 0.03), d, 10)->s, (0.5 - (sign > 0 ? 1 : -1) * 0.01 * (i + 1)) / 2, 1e-12);
    }
}

TEST(Locator, WindingNumberTellsInsideFromOutside) {
  const Surface s = conditioned(test::torus(1, 0.4, 200, 100));
  const Locator locator(s);
  double worst = 0;
  for (const Vec3& p : samples(2000, 0.6, 6)) {
    const Vec3 q = p / s.frame.scale;
    const double from_tube = std::hypot(std::hypot(q.x(), q.y()) - 1, q.z()) - 0.4;
    if (std::abs(from_tube) < 0.005) continue;
    worst = std::max(worst, std::abs(locator.winding_number(p) - (from_tube < 0 ? 1 : 0)));
  }
  EXPECT_LT(worst, 0.05);
}

TEST(Locator, OverlappingListsExactlyTheTrianglesWhoseBoxesMeet) {
  const Surface s = conditioned(test::sphere(3));
  const Locator locator(s);
  std::mt19937 random(8);
  for (const Vec3& p : samples(60, 0.5, 7)) {
    Box box;
    box.add(p);
    box.add(Vec3(p + Vec3::Constant(0.1 * (random() % 4))));
    std::vector<TriangleId> expected, found;
    for (const TriangleId t : s.triangles.ids()) {
      Box b;
      for (const Vec3& c : s.corners(t)) b.add(c);
      if ((b.min.array() <= box.max.array()).all() && (b.max.array() >= box.min.array()).all()) expected.push_back(t);
    }
    locator.overlapping(box, found);
    EXPECT_EQ(found, expected);
  }
}

}  // namespace
}  // namespace strata
