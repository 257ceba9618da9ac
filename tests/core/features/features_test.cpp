#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/base/context.h"
#include "core/features/features.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

constexpr double kPi = std::numbers::pi;

struct Found {
  Surface surface;
  Features features;
};
Found found(TriangleSoup soup, FeatureOptions options = {}) {
  Context context;
  Surface surface = condition(std::move(soup), context);
  Features features = detect_features(surface, options, context);
  return {std::move(surface), std::move(features)};
}

TriangleSoup one_patch(TriangleSoup soup) {
  soup.patch_names = {"surface"};
  soup.patch.assign(soup.triangles.size(), 0);
  return soup;
}

TEST(Features, SharpRidgesAreLeftOutWhenTheyAreToBeRounded) {
  const double angle = 40 * kPi / 180;
  const auto exact = found(one_patch(test::sharp_wedge(angle, 4))).features;
  EXPECT_EQ(exact.curves.size(), 9u);
  EXPECT_EQ(exact.rounded.length, 0);
  const auto [s, f] = found(one_patch(test::sharp_wedge(angle, 4)), {.round_sharp = true});
  // The ridge and its two ends are gone, the two curves at either end are one.
  EXPECT_EQ(f.curves.size(), 6u);
  EXPECT_EQ(f.corners.size(), 4u);
  EXPECT_EQ(f.chart_count(), 4u);
  EXPECT_NEAR(f.rounded.length, s.frame.scale, 1e-6);
  EXPECT_NEAR(f.rounded.sharpest, angle, 1e-6);
  // Borders of patches stay, and what is not so sharp.
  EXPECT_EQ(found(test::sharp_wedge(angle, 4), {.round_sharp = true}).features.curves.size(), 9u);
  EXPECT_EQ(found(one_patch(test::cube()), {.round_sharp = true}).features.curves.size(), 12u);
}

TEST(Features, CubeHasTwelveCurvesEightCornersSixCharts) {
  for (const int n : {1, 2, 5})
    for (const bool named : {true, false}) {
      const auto [s, f] = found(named ? test::cube(n) : one_patch(test::cube(n)));
      EXPECT_EQ(f.curves.size(), 12u);
      EXPECT_EQ(f.corners.size(), 8u);
      EXPECT_EQ(f.chart_count(), 6u);
      for (const Corner& c : f.corners) EXPECT_EQ(c.curves.size(), 3u);
      for (const Curve& c : f.curves) {
        EXPECT_EQ(c.points.size(), static_cast<std::size_t>(n + 1));
        EXPECT_FALSE(c.closed);
        EXPECT_TRUE(c.manifold);
        EXPECT_NEAR(c.dihedral_mean, kPi / 2, 1e-9);
        EXPECT_NEAR(c.length, 1 * s.frame.scale, 1e-12);
        EXPECT_NE(c.left, c.right);
      }
    }
}

TEST(Features, ChartsLieOnTheSideOfTheCurveThatTheyName) {
  const auto [s, f] = found(test::l_block(3));
  for (const Curve& c : f.curves)
    for (const TriangleId t : s.triangles.ids())
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k + 1 < c.points.size(); ++k)
          if (s.triangles[t][i] == c.points[k] && s.triangles[t][(i + 1) % 3] == c.points[k + 1]) {
            EXPECT_EQ(f.chart[t], c.left);
          }
}

TEST(Features, CylinderHasTwoClosedCurvesAndNoCorner) {
  for (const int segments : {10, 16, 32, 100}) {
    const auto [s, f] = found(one_patch(test::cylinder(segments)));
    EXPECT_EQ(f.curves.size(), 2u) << segments;
    EXPECT_EQ(f.corners.size(), 0u);
    EXPECT_EQ(f.chart_count(), 3u);
    for (const Curve& c : f.curves) {
      EXPECT_TRUE(c.closed);
      EXPECT_FALSE(c.first.valid());
      EXPECT_EQ(c.points.size(), static_cast<std::size_t>(segments));
      EXPECT_NEAR(c.dihedral_min, kPi / 2, 1e-9);
    }
  }
}

TEST(Features, ConeHasOneClosedCurveAndATip) {
  const auto [s, f] = found(one_patch(test::cone()));
  EXPECT_EQ(f.curves.size(), 1u);
  ASSERT_EQ(f.corners.size(), 1u);
  EXPECT_TRUE(f.corners[CornerId(0)].curves.empty());
  EXPECT_EQ(f.chart_count(), 2u);
}

TEST(Features, LBlockHasOneReentrantCurve) {
  const auto [s, f] = found(one_patch(test::l_block(2)));
  EXPECT_EQ(f.curves.size(), 18u);
  EXPECT_EQ(f.corners.size(), 12u);
  EXPECT_EQ(f.chart_count(), 8u);
  int reentrant = 0;
  for (const Curve& c : f.curves) reentrant += std::abs(c.dihedral_mean - 1.5 * kPi) < 1e-9;
  EXPECT_EQ(reentrant, 1);
}

TEST(Features, SmoothShapesHaveNone) {
  for (const TriangleSoup& soup : {test::sphere(2), test::sphere(4), test::torus()}) {
    const auto [s, f] = found(soup);
    EXPECT_EQ(f.curves.size(), 0u);
    EXPECT_EQ(f.corners.size(), 0u);
    EXPECT_EQ(f.chart_count(), 1u);
  }
}

TEST(Features, AFlatPatchBorderIsACurveOfAngleZero) {
  const auto [s, f] = found(test::two_patches(4));
  EXPECT_EQ(f.curves.size(), 15u);
  EXPECT_EQ(f.corners.size(), 10u);
  EXPECT_EQ(f.chart_count(), 7u);
  int flat = 0;
  for (const Curve& c : f.curves) flat += std::abs(c.dihedral_mean - kPi) < 1e-9;
  EXPECT_EQ(flat, 1);
}

TEST(Features, SharpWedgeKnowsItsAngle) {
  for (const double angle : {0.1, 0.5, 1.0}) {
    const auto [s, f] = found(test::sharp_wedge(angle, 3));
    EXPECT_EQ(f.curves.size(), 9u);
    double least = 9;
    for (const Curve& c : f.curves) least = std::min(least, c.dihedral_mean);
    EXPECT_NEAR(least, angle, 1e-9);
  }
}

TEST(Features, OpenBordersAreNeitherCurvesNorTips) {
  TriangleSoup soup = one_patch(test::cylinder(24));
  TriangleSoup open{soup.points, {}, {}, soup.patch_names};
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    bool top = true;
    for (const std::int32_t p : soup.triangles[t]) top = top && soup.points[p].z() > 1.999;
    if (top) continue;
    open.triangles.push_back(soup.triangles[t]);
    open.patch.push_back(0);
  }
  const auto [s, f] = found(open);
  ASSERT_EQ(f.curves.size(), 1u);  // the rim that still has both sides
  EXPECT_TRUE(f.curves[CurveId(0)].manifold);
  EXPECT_TRUE(f.corners.empty());
  EXPECT_EQ(f.chart_count(), 2u);
}

TEST(Features, TheRimOfAnInterfaceIsNonManifold) {
  const auto [s, f] = found(test::touching_cubes(2));
  EXPECT_EQ(f.chart_count(), 11u);
  EXPECT_EQ(f.curves.size(), 20u);
  EXPECT_EQ(f.corners.size(), 12u);
  int rim = 0;
  for (const Curve& c : f.curves) rim += !c.manifold;
  EXPECT_EQ(rim, 4);
}

TEST(Features, JitterAndOrderDoNotChangeTheGraph) {
  for (const std::uint32_t seed : {1u, 2u, 3u}) {
    const auto block =
        found(test::shuffled(test::jittered(test::rotated(one_patch(test::l_block(8)), Vec3(1, 2, 3), 1), 1e-3, seed), seed)).features;
    EXPECT_EQ(block.curves.size(), 18u);
    EXPECT_EQ(block.corners.size(), 12u);
    EXPECT_EQ(block.chart_count(), 8u);
    const auto ball = found(test::jittered(test::sphere(4), 1e-3, seed)).features;
    EXPECT_EQ(ball.curves.size(), 0u);
    const auto round = found(test::jittered(one_patch(test::cylinder(40)), 1e-3, seed)).features;
    EXPECT_EQ(round.curves.size(), 2u);
    EXPECT_EQ(round.corners.size(), 0u);
  }
}

// Whether a crease is too small to matter depends on the cells: the match decides.
TEST(Features, ASingleSharpEdgeIsACrease) {
  TriangleSoup soup = test::sphere(4);
  soup.points[700] *= 1.02;
  const auto [s, f] = found(soup, {.ridge_angle = 0.3});
  EXPECT_GT(f.curves.size(), 0u);
  for (const Curve& c : f.curves) EXPECT_LT(c.length, 0.2 * s.box.diagonal());
}

TEST(Features, EveryEdgeBetweenTwoChartsBelongsToACurve) {
  const auto [s, f] = found(test::two_patches(6));
  std::size_t curve_edges = 0, borders = 0;
  for (const Curve& c : f.curves) curve_edges += c.points.size() - (c.closed ? 0 : 1);
  for (const TriangleId t : s.triangles.ids())
    for (const TriangleId n : s.neighbours[t]) borders += f.chart[t] < f.chart[n];
  EXPECT_EQ(curve_edges, borders);
}

}  // namespace
}  // namespace strata
