#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/base/context.h"
#include "core/sizing/size_field.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

struct Sized {
  Surface surface;
  SizeField field;
};
Sized sized(TriangleSoup soup, SizeOptions options) {
  Context context;
  Surface surface = condition(std::move(soup), context);
  const Features features = detect_features(surface, {}, context);
  SizeField field = make_size_field(surface, features, options, context);
  return {std::move(surface), std::move(field)};
}
SizeOptions options() {
  SizeOptions o;
  o.max_size = 0.1;
  return o;
}

TEST(SizeField, NothingAskedGivesNoWish) {
  const auto [s, f] = sized(test::cube(3), options());
  for (const double size : f.at_triangle) EXPECT_EQ(size, kNone);
  EXPECT_EQ(f.max_size, 0.1);
}

TEST(SizeField, PatchesTakeTheirSizeAndTheBound) {
  SizeOptions o = options();
  o.min_size = 0.01;
  o.patch_size = IdMap<PatchId, double>{0.05, kNone, 0.001, kNone, kNone, kNone};
  const auto [s, f] = sized(test::cube(3), o);
  for (const TriangleId t : s.triangles.ids())
    EXPECT_EQ(f.at_triangle[t], s.patch[t].value == 0 ? 0.05 : s.patch[t].value == 2 ? 0.01 : kNone);
}

TEST(SizeField, CurvatureOfASphereGivesItsChord) {
  for (const int subdivisions : {3, 4}) {
    SizeOptions o = options();
    o.curvature = 0.3;
    const auto [s, f] = sized(test::sphere(subdivisions), o);
    const double expected = 2 * s.frame.scale * std::sin(0.15);
    for (const double size : f.at_triangle) {
      EXPECT_GT(size, 0.5 * expected);
      EXPECT_LT(size, 1.2 * expected);
    }
  }
}

TEST(SizeField, CurvatureIgnoresRidgesAndFlats) {
  SizeOptions o = options();
  o.curvature = 0.3;
  const auto [s, f] = sized(test::cube(4), o);
  for (const double size : f.at_triangle) EXPECT_EQ(size, kNone);
}

TEST(SizeField, CurvatureOfACylinderIsThatOfItsRadiusWhateverTheTessellation) {
  SizeOptions o = options();
  o.curvature = 0.3;
  for (const int rings : {1, 8, 30}) {
    const auto [s, f] = sized(test::cylinder(40, 2, rings), o);
    const double expected = 2 * s.frame.scale * std::sin(0.15);
    for (const TriangleId t : s.triangles.ids()) {
      if (s.patch_names[s.patch[t]] != "side") continue;
      EXPECT_GT(f.at_triangle[t], 0.4 * expected);
      EXPECT_LT(f.at_triangle[t], 2 * expected);
    }
  }
}

TEST(SizeField, GapsAskForTheirCellsAcross) {
  SizeOptions o = options();
  o.gap_cells = 4;
  const auto [s, f] = sized(test::box(Vec3::Zero(), Vec3(1, 1, 0.1), 10), o);
  for (const TriangleId t : s.triangles.ids()) {
    const std::string& name = s.patch_names[s.patch[t]];
    if (name == "z_min" || name == "z_max") EXPECT_NEAR(f.at_triangle[t], 0.1 * s.frame.scale / 4, 1e-6);
    else EXPECT_GE(f.at_triangle[t], 0.1 * s.frame.scale);
  }
}

TEST(SizeField, BoxesAreOrderedAndBounded) {
  SizeOptions o = options();
  o.min_size = 0.02;
  o.sources = {{SizeSource::Shape::Box, Vec3::Constant(0.2), Vec3::Constant(-0.2), 0, 0.01}};
  const auto [s, f] = sized(test::cube(1), o);
  EXPECT_EQ(f.sources[0].a, Vec3::Constant(-0.2));
  EXPECT_EQ(f.sources[0].size, 0.02);
}

}  // namespace
}  // namespace strata
