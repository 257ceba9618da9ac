// Solid about as thin as a cell is kept whole, whatever its place on the grid.
#include "core/carve/thin_places.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/base/context.h"
#include "core/buffer/wrap.h"
#include "core/carve/carve.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

using testing::check_topology;

constexpr int kCells = 40;
constexpr double kSize = 1.6 / kCells;

double uniform(std::mt19937& random, double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

// The shape, turned and shifted at random, in the frame that it is meshed in, which must be as large as the shape's own.
HexMesh carve_at_random(TriangleSoup soup, std::mt19937& random, std::vector<Vec3>& marks) {
  const Vec3 axis(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, 0.1, 1));
  const double angle = uniform(random, 0, 3);
  TriangleSoup marked;
  marked.points = std::move(marks);
  Context context;
  const Surface surface = condition(test::rotated(std::move(soup), axis, angle), context);
  EXPECT_EQ(surface.frame.scale, 1);
  marks = test::rotated(std::move(marked), axis, angle).points;
  for (Vec3& p : marks) p = surface.frame.to_work(p);
  const Locator locator(surface);
  const Vec3 shift = 0.5 * kSize * Vec3(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1));
  return carve(testing::uniform_dual(locator, kCells, shift), surface, locator, {.volume = {}, .depth = 0.3, .thin_places = true}, context)
      .mesh;
}

// From the mark to the nearest vertex, in cells.
double farthest(const HexMesh& mesh, const std::vector<Vec3>& marks) {
  double result = 0;
  for (const Vec3& p : marks) {
    double nearest = 1e9;
    for (const Vec3& q : mesh.position) nearest = std::min(nearest, (q - p).norm());
    result = std::max(result, nearest / kSize);
  }
  return result;
}

TEST(ThinPlaces, PlatesAreKeptWhole) {
  std::mt19937 random(7);
  for (const double thickness : {1.0, 1.4, 2.0}) {
    for (int turn = 0; turn < 12; ++turn) {
      SCOPED_TRACE(std::to_string(thickness) + " cells, turn " + std::to_string(turn));
      const double half = 0.5 * thickness * kSize;
      std::vector<Vec3> marks;
      for (double at : {-0.2, 0.0, 0.2})
        for (double rim : {-0.3, 0.3}) {
          marks.emplace_back(at, rim, 0);
          marks.emplace_back(rim, at, 0);
        }
      Context context;
      const HexMesh mesh = carve_at_random(test::box(Vec3(-0.3, -0.3, -half), Vec3(0.3, 0.3, half), 4), random, marks);
      EXPECT_EQ(check_topology(mesh), "");
      EXPECT_EQ(testing::euler_of_boundary(mesh), 2);  // one piece, no holes
      EXPECT_LT(farthest(mesh, marks), 1.2);
      EXPECT_EQ(check_topology(wrap_surface(mesh, context)), "");
    }
  }
}

TEST(ThinPlaces, TipsOfWedgesAreReached) {
  std::mt19937 random(11);
  for (const double degrees : {30.0, 45.0}) {
    for (int turn = 0; turn < 12; ++turn) {
      SCOPED_TRACE(std::to_string(degrees) + " degrees, turn " + std::to_string(turn));
      std::vector<Vec3> marks;
      for (double y : {0.1, 0.2, 0.3, 0.4, 0.5}) marks.emplace_back(0, y, 0);
      const HexMesh mesh = carve_at_random(test::scaled(test::sharp_wedge(degrees * std::numbers::pi / 180), 0.6), random, marks);
      EXPECT_EQ(check_topology(mesh), "");
      EXPECT_EQ(testing::euler_of_boundary(mesh), 2);
      EXPECT_LT(farthest(mesh, marks), 1.2);
    }
  }
}

}  // namespace
}  // namespace strata
