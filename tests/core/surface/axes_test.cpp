#include "core/surface/axes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/base/context.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

Surface conditioned(TriangleSoup soup) {
  Context context;
  return condition(std::move(soup), context);
}

// Least cosine of a face's normal with the nearest axis.
double worst_alignment(const Surface& surface, const Mat3& axes) {
  double worst = 1;
  for (const Vec3& n : surface.normal) worst = std::min(worst, (axes * n).cwiseAbs().maxCoeff());
  return worst;
}

TEST(Axes, TurnWithAPartHoweverItStands) {
  std::mt19937 random(5);
  std::normal_distribution<double> any;
  for (int i = 0; i < 20; ++i) {
    const Vec3 axis = Vec3(any(random), any(random), any(random));
    const Surface surface = conditioned(test::rotated(test::l_block(4), axis, any(random)));
    const Mat3 axes = best_axes(surface);
    EXPECT_GT(worst_alignment(surface, axes), 1 - 1e-12);
    EXPECT_LT((axes * axes.transpose() - Mat3::Identity()).norm(), 1e-14);
    EXPECT_NEAR(axes.determinant(), 1, 1e-14);
    EXPECT_GT(axes.trace(), 1.7) << "the smallest of 24 turns is one of 63 degrees at most";
  }
}

TEST(Axes, ASmallTiltIsTakenOutToo) {
  const Surface surface = conditioned(test::rotated(test::cube(4), Vec3(1, 2, 3), 0.01));
  EXPECT_LT(worst_alignment(surface, Mat3::Identity()), 1 - 1e-5);
  EXPECT_GT(worst_alignment(surface, best_axes(surface)), 1 - 1e-12);
}

TEST(Axes, StayWhereTheSurfacePrefersNone) {
  for (const TriangleSoup& soup : {test::cube(4), test::l_block(4), test::sphere(3), test::cylinder(64, 2, 8)})
    EXPECT_EQ(best_axes(conditioned(soup)), Mat3(Mat3::Identity()));
}

TEST(Axes, TheGreatestFacesLieExactlyAlongThem) {
  // A block whose smaller side faces lean by ten degrees.
  TriangleSoup soup = test::box(Vec3::Zero(), Vec3(2, 0.5, 2), 4);
  for (Vec3& p : soup.points) p.x() += std::tan(std::numbers::pi / 18) * p.y();
  const Surface surface = conditioned(test::rotated(soup, Vec3(1, -1, 2), 1));
  const Mat3 axes = best_axes(surface);
  double along = 0;
  for (const Vec3& n : surface.normal) along += (axes * n).cwiseAbs().maxCoeff() > 1 - 1e-12 ? 1 : 0;
  EXPECT_GT(along, 0.6 * static_cast<double>(surface.normal.size()));
}

TEST(Axes, ATurnedSurfaceIsTheSameInTheInput) {
  const Surface surface = conditioned(test::rotated(test::l_block(2), Vec3(1, 2, 3), 0.7));
  const Surface turned_one = turned(surface, best_axes(surface));
  ASSERT_TRUE(turned_one.frame.turn.has_value());
  EXPECT_EQ(turned_one.longest_side, surface.longest_side);
  EXPECT_NEAR(turned_one.box.extent().maxCoeff(), turned_one.box.extent().minCoeff() * 2, 1e-12) << "an L of 2 x 2 x 1 in its own axes";
  for (PointId p : surface.points.ids()) {
    const Vec3 input = surface.frame.to_input(surface.points[p]);
    EXPECT_LT((turned_one.frame.to_input(turned_one.points[p]) - input).norm(), 1e-14);
    EXPECT_LT((turned_one.frame.to_work(input) - turned_one.points[p]).norm(), 1e-14);
  }
  Box back = turned_one.frame.to_input(turned_one.box);
  for (PointId p : surface.points.ids()) {
    const Vec3 input = surface.frame.to_input(surface.points[p]);
    EXPECT_TRUE((input.array() > back.min.array() - 1e-12).all() && (input.array() < back.max.array() + 1e-12).all());
  }
}

}  // namespace
}  // namespace strata
