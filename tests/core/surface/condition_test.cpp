#include <gtest/gtest.h>

#include <cmath>

#include "core/base/context.h"
#include "core/surface/surface.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

double volume(const Surface& s) {
  double sum = 0;
  for (const TriangleId t : s.triangles.ids()) {
    const auto [a, b, c] = s.corners(t);
    sum += a.dot(b.cross(c)) / 6;
  }
  return sum;
}

Surface conditioned(TriangleSoup soup) {
  Context context;
  return condition(std::move(soup), context);
}

std::int64_t reported(const Context& context, Reason reason) {
  std::int64_t count = 0;
  for (const Diagnostic& d : context.adjustments())
    if (d.reason == reason) count += d.count;
  return count;
}

TEST(Condition, CubeKeepsItsTrianglesPatchesAndVolume) {
  Context context;
  const Surface s = condition(test::cube(3), context);
  EXPECT_EQ(s.triangles.size(), 108u);
  EXPECT_EQ(s.points.size(), 56u);
  EXPECT_EQ(s.patch_names.size(), 6u);
  EXPECT_TRUE(s.closed);
  EXPECT_EQ(s.component_count, 1);
  EXPECT_NEAR(volume(s), 1, 1e-12);
  EXPECT_TRUE(context.adjustments().empty());
}

TEST(Condition, CoordinatesBeyondWhatReadersOfTheMeshBearAreRefused) {
  for (const double factor : {1e30, 1e200}) {
    try {
      conditioned(test::scaled(test::cube(1), factor));
      FAIL() << factor;
    } catch (const MeshError& error) {
      EXPECT_EQ(error.failure(), Failure::InvalidInput);
      EXPECT_EQ(error.diagnostic().reason, Reason::SurfaceExtentUnusable);
    }
  }
}

TEST(Condition, WorkingFrameIsCentredAndItsLongestSideLiesBetweenHalfAndOne) {
  for (const double factor : {1.0, 0.3, 7.0, 1e29, 1e-30, 1e-200}) {
    const TriangleSoup soup = test::scaled(test::l_block(2), factor);
    const Surface s = conditioned(soup);
    const double longest = s.box.extent().maxCoeff();
    EXPECT_GT(longest, 0.5) << factor;
    EXPECT_LE(longest, 1.0) << factor;
    EXPECT_LT(s.box.centre().norm(), 1e-12);
    int exponent;
    EXPECT_EQ(std::frexp(s.frame.scale, &exponent), 0.5) << "a power of two";
    EXPECT_TRUE(s.closed);
    const Vec3 p(0.25, 0.125, -0.5);
    EXPECT_LT((s.frame.to_work(s.frame.to_input(p)) - p).norm(), 1e-15);
  }
}

TEST(Condition, ExplodedAndShuffledTrianglesAreWelded) {
  const Surface s = conditioned(test::exploded(test::shuffled(test::sphere(3), 1)));
  EXPECT_TRUE(s.closed);
  EXPECT_EQ(s.points.size(), 642u);
  EXPECT_EQ(s.component_count, 1);
}

TEST(Condition, NoiseOfAMillionthIsWelded) {
  const Surface s = conditioned(test::jittered(test::exploded(test::cube(4)), 1e-6, 3));
  EXPECT_TRUE(s.closed);
  EXPECT_EQ(s.triangles.size(), 192u);
}

TEST(Condition, FlippedTrianglesAreTurnedOutwardsAndReported) {
  TriangleSoup soup = test::cube(2);
  for (std::size_t t = 0; t < soup.triangles.size(); t += 3) std::swap(soup.triangles[t][0], soup.triangles[t][1]);
  Context context;
  EXPECT_NEAR(volume(condition(soup, context)), 1, 1e-12);
  EXPECT_EQ(reported(context, Reason::SurfaceInconsistentOrientation), 16);
  EXPECT_NEAR(volume(conditioned(test::flipped(test::cube(2)))), 1, 1e-12);
}

TEST(Condition, EveryClosedComponentPointsOutwards) {
  const Surface s = conditioned(test::joined(test::box(Vec3::Constant(-2), Vec3::Constant(2), 2), test::flipped(test::sphere(2))));
  EXPECT_EQ(s.component_count, 2);
  EXPECT_GT(volume(s) / std::pow(s.frame.scale, 3), 64);
}

TEST(Condition, DegenerateAndDuplicateTrianglesAreDroppedAndListed) {
  TriangleSoup soup = test::cube(2);
  soup.triangles.push_back({0, 0, 1});
  soup.triangles.push_back({0, 1, 1});
  soup.triangles.push_back(soup.triangles[5]);
  soup.triangles.push_back({soup.triangles[6][1], soup.triangles[6][0], soup.triangles[6][2]});
  soup.patch.resize(soup.triangles.size(), 0);
  Context context;
  const Surface s = condition(soup, context);
  EXPECT_TRUE(s.closed);
  EXPECT_EQ(s.triangles.size(), 48u);
  EXPECT_EQ(reported(context, Reason::SurfaceDegenerateTriangles), 2);
  EXPECT_EQ(reported(context, Reason::SurfaceDuplicateTriangles), 2);
  EXPECT_EQ(context.adjustments()[0].triangles, (std::vector<std::int64_t>{48, 49}));
}

TEST(Condition, HangingVerticesAreStitched) {
  // One face of the box is finer than its neighbours.
  TriangleSoup coarse = test::cube(1), fine = test::cube(4), soup;
  soup.points = coarse.points;
  soup.patch_names = coarse.patch_names;
  const auto offset = static_cast<std::int32_t>(coarse.points.size());
  soup.points.insert(soup.points.end(), fine.points.begin(), fine.points.end());
  for (std::size_t t = 0; t < coarse.triangles.size(); ++t)
    if (coarse.patch[t] != 5) {
      soup.triangles.push_back(coarse.triangles[t]);
      soup.patch.push_back(coarse.patch[t]);
    }
  for (std::size_t t = 0; t < fine.triangles.size(); ++t)
    if (fine.patch[t] == 5) {
      soup.triangles.push_back({fine.triangles[t][0] + offset, fine.triangles[t][1] + offset, fine.triangles[t][2] + offset});
      soup.patch.push_back(5);
    }
  Context context;
  const Surface s = condition(soup, context);
  EXPECT_TRUE(s.closed);
  EXPECT_NEAR(volume(s), 1, 1e-12);
  EXPECT_EQ(reported(context, Reason::SurfaceNotClosed), 4);
}

TEST(Condition, OpenEdgesAreReportedWithTheirPlaceInInputUnits) {
  TriangleSoup soup = test::shifted(test::scaled(test::cube(2), 10), Vec3(100, 0, 0));
  for (std::size_t t = soup.triangles.size(); t-- > 0;)
    if (soup.patch_names[static_cast<std::size_t>(soup.patch[t])] == "x_min") {
      soup.triangles.erase(soup.triangles.begin() + static_cast<std::ptrdiff_t>(t));
      soup.patch.erase(soup.patch.begin() + static_cast<std::ptrdiff_t>(t));
    }
  Context context;
  EXPECT_FALSE(condition(soup, context).closed);
  ASSERT_EQ(context.adjustments().size(), 1u);
  const Diagnostic& d = context.adjustments()[0];
  EXPECT_EQ(d.reason, Reason::SurfaceNotClosed);
  EXPECT_EQ(d.count, 8);
  EXPECT_NEAR(d.box.max.x(), 100, 1e-9);
  EXPECT_NEAR(d.box.extent().y(), 10, 1e-9);
}

TEST(Condition, FreeSheetsAreDroppedFromClosedSolids) {
  TriangleSoup soup = test::cube(2);
  const auto n = static_cast<std::int32_t>(soup.points.size());
  for (const Vec3& p : {Vec3(.4, .4, .4), Vec3(.6, .4, .4), Vec3(.6, .6, .5), Vec3(.4, .6, .5)}) soup.points.push_back(p);
  soup.triangles.push_back({n, n + 1, n + 2});
  soup.triangles.push_back({n, n + 2, n + 3});
  soup.patch.resize(soup.triangles.size(), 0);
  Context context;
  const Surface s = condition(soup, context);
  EXPECT_TRUE(s.closed);
  EXPECT_EQ(s.triangles.size(), 48u);
  EXPECT_EQ(reported(context, Reason::SurfaceSheetDropped), 2);
}

TEST(Condition, TheInterfaceOfTouchingSolidsIsKeptOnce) {
  const Surface s = conditioned(test::touching_cubes(2));
  EXPECT_TRUE(s.closed);
  EXPECT_EQ(s.triangles.size(), 88u);
  EXPECT_EQ(s.component_count, 1);
}

Reason refusal(const TriangleSoup& soup) {
  try {
    conditioned(soup);
  } catch (const MeshError& e) {
    return e.diagnostic().reason;
  }
  return Reason::InvariantViolated;
}

TEST(Condition, UnusableInputIsRefusedWithItsReason) {
  EXPECT_EQ(refusal({}), Reason::SurfaceEmpty);
  TriangleSoup soup = test::cube(2);
  soup.points[3].x() = std::nan("");
  EXPECT_EQ(refusal(soup), Reason::SurfaceNonFinite);
  soup = test::cube(2);
  soup.points[3].x() = 1e30;
  EXPECT_EQ(refusal(soup), Reason::SurfaceExtentUnusable);
  soup = test::cube(2);
  for (Vec3& p : soup.points) p.z() = 4;
  EXPECT_EQ(refusal(soup), Reason::SurfaceExtentUnusable);
  for (Vec3& p : soup.points) p = Vec3::Ones();
  EXPECT_EQ(refusal(soup), Reason::SurfaceExtentUnusable);
  soup.triangles[0][0] = 4000;
  EXPECT_EQ(refusal(soup), Reason::SurfaceIndexOutOfRange);
}

}  // namespace
}  // namespace strata
