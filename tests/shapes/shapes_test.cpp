#include "bench/shapes/shapes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <utility>

namespace strata::shapes {
namespace {

using Edge = std::pair<int, int>;

Point normal_of(const PatchedSurface& surface, const std::array<int, 3>& t) {
  std::array<Point, 2> side{};
  for (int i = 0; i < 3; ++i) {
    side[0][i] = surface.points[t[1]][i] - surface.points[t[0]][i];
    side[1][i] = surface.points[t[2]][i] - surface.points[t[0]][i];
  }
  Point n = {side[0][1] * side[1][2] - side[0][2] * side[1][1], side[0][2] * side[1][0] - side[0][0] * side[1][2],
             side[0][0] * side[1][1] - side[0][1] * side[1][0]};
  const double length = std::hypot(n[0], n[1], n[2]);
  for (double& value : n) value /= length;
  return n;
}

// Largest angle between the normals of two triangles that share an edge, degrees.
double largest_turn(const PatchedSurface& surface) {
  std::map<Edge, Point> first;
  double least_cosine = 1;
  for (const auto& t : surface.triangles) {
    const auto n = normal_of(surface, t);
    for (int i = 0; i < 3; ++i) {
      const auto [other, inserted] = first.try_emplace(std::minmax(t[i], t[(i + 1) % 3]), n);
      if (inserted) continue;
      const auto& m = other->second;
      least_cosine = std::min(least_cosine, n[0] * m[0] + n[1] * m[1] + n[2] * m[2]);
    }
  }
  return std::acos(std::clamp(least_cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
}

TEST(Shapes, EveryShapeIsWatertightAndOrientedAtEveryFineness) {
  for (const auto& shape : all_shapes()) {
    for (const int fineness : {1, 2, 3}) {
      const auto faults = edge_faults(shape.make(fineness));
      EXPECT_EQ(faults.open, 0) << shape.name << " at fineness " << fineness;
      EXPECT_EQ(faults.crowded, 0) << shape.name << " at fineness " << fineness;
      EXPECT_EQ(faults.misoriented, 0) << shape.name << " at fineness " << fineness;
    }
  }
}

TEST(Shapes, EveryShellTurnsOutwards) {
  for (const auto& shape : all_shapes()) EXPECT_GT(enclosed_volume(shape.make(1)), 0) << shape.name;
  EXPECT_NEAR(enclosed_volume(cube(1)), 1, 1e-12);
  EXPECT_GT(enclosed_volume(rocket(1)), 16 * 12 * 12);
  EXPECT_GT(enclosed_volume(fighter(1)), 36 * 32 * 28);
  EXPECT_LT(enclosed_volume(wing(1)), 8 * 5 * 7);
  EXPECT_LT(enclosed_volume(mirror(1)), 6 * 3 * 2);
  EXPECT_LT(enclosed_volume(hull(1)), 20 * 6 * 4);
  EXPECT_NEAR(enclosed_volume(cylinder(4)), std::numbers::pi / 2, 2e-3);
  EXPECT_NEAR(enclosed_volume(sphere_in_box(2)), 216 + std::numbers::pi / 6, 2e-3);
}

TEST(Shapes, NoEdgeOfTheRocketIsSharperThanARightAngleByMuch) {
  // Solid angles at the edges stay above 60 degrees as long as no fold turns by 120 or more.
  EXPECT_LT(largest_turn(rocket(1)), 110);
  EXPECT_LT(largest_turn(rocket(2)), 110);
}

TEST(Shapes, TheRocketHasItsPatches) {
  const auto surface = rocket(1);
  const std::set<std::string> names(surface.patch_names.begin(), surface.patch_names.end());
  const std::set<std::string> wanted = {"nose",         "body",          "fins",  "base",   "nozzle_outer", "nozzle_lip",
                                        "nozzle_inner", "nozzle_throat", "inlet", "outlet", "farfield"};
  EXPECT_EQ(names, wanted);
}

TEST(Shapes, TheRocketsFourFinsAreAlike) {
  const auto surface = rocket(1);
  std::array<double, 4> reach{};
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    if (surface.patch_names[surface.patch_of[t]] != "fins") continue;
    for (const int p : surface.triangles[t]) {
      const auto& point = surface.points[p];
      reach[0] = std::max(reach[0], point[1]);
      reach[1] = std::max(reach[1], point[2]);
      reach[2] = std::max(reach[2], -point[1]);
      reach[3] = std::max(reach[3], -point[2]);
    }
  }
  for (const double r : reach) EXPECT_EQ(r, reach[0]);
}

TEST(Shapes, AnAsciiStlHasOneNamedSolidPerPatch) {
  const std::string path = testing::TempDir() + "strata_shapes_cube.stl";
  write(cube(1), path, FileKind::StlAscii);
  std::ifstream file(path);
  std::set<std::string> solids;
  int facets = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("solid ")) solids.insert(line.substr(6));
    if (line.starts_with("facet ")) ++facets;
  }
  EXPECT_EQ(solids, (std::set<std::string>{"xmin", "xmax", "ymin", "ymax", "zmin", "zmax"}));
  EXPECT_EQ(facets, 192);
  std::remove(path.c_str());
}

}  // namespace
}  // namespace strata::shapes
