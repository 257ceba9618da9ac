// What every shape must be besides watertight: free of crossings and slivers, one closed sheet round every point, its patches named.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <string>

#include "bench/shapes/planar.h"
#include "bench/shapes/shapes.h"
#include "tests/shapes/crossings.h"

namespace strata::shapes {
namespace {

double area_of(const PatchedSurface& surface, int t) {
  Point u, v;
  const auto& [a, b, c] = surface.triangles[t];
  for (int d = 0; d < 3; ++d) u[d] = surface.points[b][d] - surface.points[a][d], v[d] = surface.points[c][d] - surface.points[a][d];
  return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
}

double longest_edge(const PatchedSurface& surface, int t) {
  double longest = 0;
  for (int i = 0; i < 3; ++i) {
    const auto& p = surface.points[surface.triangles[t][i]];
    const auto& q = surface.points[surface.triangles[t][(i + 1) % 3]];
    longest = std::max(longest, std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]));
  }
  return longest;
}

double least_height(const PatchedSurface& surface, int t) { return 2 * area_of(surface, t) / longest_edge(surface, t); }

// Points whose triangles are not one fan.
int pinched_points(const PatchedSurface& surface) {
  std::map<int, std::vector<std::pair<int, int>>> opposite;  // per point, the edges across from it
  for (const auto& t : surface.triangles) {
    for (int i = 0; i < 3; ++i) opposite[t[i]].emplace_back(t[(i + 1) % 3], t[(i + 2) % 3]);
  }
  int pinched = 0;
  for (const auto& [point, edges] : opposite) {
    std::map<int, int> next(edges.begin(), edges.end());
    std::size_t walked = 0;
    for (int at = edges.front().first; walked < edges.size();) {
      at = next[at];
      ++walked;
      if (at == edges.front().first) break;
    }
    pinched += walked == edges.size() ? 0 : 1;
  }
  return pinched;
}

std::set<std::string> names_of(const PatchedSurface& surface) { return {surface.patch_names.begin(), surface.patch_names.end()}; }

double patch_area(const PatchedSurface& surface, const std::string& name) {
  double area = 0;
  for (int t = 0; t < static_cast<int>(surface.triangles.size()); ++t) {
    if (surface.patch_names[surface.patch_of[t]] == name) area += area_of(surface, t);
  }
  return area;
}

TEST(Soundness, CrossingsAreFound) {
  PatchedSurface surface;
  const auto triangle = [&](const Point& a, const Point& b, const Point& c) {
    const int first = surface.add_point(a);
    surface.add_triangle(first, surface.add_point(b), first + 2, surface.patch("any"));
    surface.add_point(c);
  };
  triangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  triangle({0.15, 0.15, -1}, {0.15, 0.15, 1}, {1, 1, 0.5});     // through the first
  triangle({2, 0.2, -1}, {2, 0.2, 1}, {3, 1, 0.5});         // beside it
  triangle({0.1, 0.1, 0.01}, {0.3, 0.1, 0.01}, {0.1, 0.3, 0.01});  // above it, crossed by the second alone
  surface.add_triangle(0, 2, 1, 0);                         // folded onto the first
  EXPECT_EQ(crossings(surface), (std::vector<std::pair<int, int>>{{0, 1}, {0, 4}, {1, 3}, {1, 4}}));
}

TEST(Soundness, NoTrianglesOfAShapeCross) {
  for (const auto& shape : all_shapes()) {
    for (const int fineness : {1, 2}) {
      const auto surface = shape.make(fineness);
      const auto found = crossings(surface);
      for (std::size_t i = 0; i < std::min<std::size_t>(found.size(), 3); ++i) {
        const auto& p = surface.points[surface.triangles[found[i].first][0]];
        const auto& name = surface.patch_names[surface.patch_of[found[i].first]];
        ADD_FAILURE() << shape.name << ", fineness " << fineness << ": " << name << " is crossed near " << p[0] << " " << p[1] << " "
                      << p[2];
      }
      EXPECT_EQ(found.size(), 0) << shape.name << " at fineness " << fineness;
    }
  }
}

TEST(Soundness, NoTriangleOfAShapeIsDegenerate) {
  for (const auto& shape : all_shapes()) {
    for (const int fineness : {1, 2, 4}) {
      const auto surface = shape.make(fineness);
      double worst = 1;
      for (int t = 0; t < static_cast<int>(surface.triangles.size()); ++t) {
        worst = std::min(worst, least_height(surface, t) / longest_edge(surface, t));
      }
      EXPECT_GT(worst, 1e-4) << shape.name << " at fineness " << fineness;
    }
  }
}

TEST(Soundness, OneSheetLiesRoundEveryPoint) {
  for (const auto& shape : all_shapes()) {
    for (const int fineness : {1, 2}) EXPECT_EQ(pinched_points(shape.make(fineness)), 0) << shape.name << " at fineness " << fineness;
  }
}

TEST(Soundness, ShapesHaveTheirPatches) {
  using Names = std::set<std::string>;
  EXPECT_EQ(names_of(fighter(1)), (Names{"body", "intake", "exhaust", "wing", "tail", "tail_wing", "inlet", "outlet", "farfield"}));
  EXPECT_EQ(names_of(hull(1)), (Names{"hull", "keel", "transom", "symmetry", "free_surface", "inlet", "outlet", "side", "bottom"}));
  EXPECT_EQ(names_of(mirror(1)), (Names{"housing", "rim", "glass", "foot", "plate", "wall", "inlet", "outlet", "sides", "top"}));
  EXPECT_EQ(names_of(wing(1)), (Names{"wing", "symmetry", "inlet", "outlet", "farfield"}));
  EXPECT_EQ(names_of(bracket(1)), (Names{"top", "bottom", "side", "bores"}));
}

TEST(Soundness, EveryPatchHasArea) {
  for (const auto& shape : all_shapes()) {
    const auto surface = shape.make(1);
    for (const auto& name : surface.patch_names) EXPECT_GT(patch_area(surface, name), 1e-3) << shape.name << ": " << name;
  }
}

TEST(Soundness, TheFighterIsMirroredInItsMiddle) {
  const auto surface = fighter(1);
  for (const std::string& name : surface.patch_names) {
    double moment = 0;
    for (int t = 0; t < static_cast<int>(surface.triangles.size()); ++t) {
      if (surface.patch_names[surface.patch_of[t]] != name) continue;
      double y = 0;
      for (const int p : surface.triangles[t]) y += surface.points[p][1] / 3;
      moment += y * area_of(surface, t);
    }
    EXPECT_NEAR(moment / patch_area(surface, name), 0, 1e-2) << name;
  }
}

TEST(Soundness, TheBracketEnclosesItsPlateLessTheBores) {
  EXPECT_NEAR(enclosed_volume(bracket(8)), 0.5 * (4 * 1.2 + 1.2 * 1.8 - 3.14159265 * (0.09 + 0.09 + 0.16)), 1e-3);
}

TEST(Planar, AFaceWithHolesIsFilledOnceAndOnlyOnItsPoints) {
  PatchedSurface surface;
  const auto ring = [&](double x, double y, double radius, int n) {
    Row loop;
    for (int i = 0; i < n; ++i)
      loop.push_back(surface.add_point({x + radius * std::cos(6.283185307 * i / n), y + radius * std::sin(6.283185307 * i / n), 1}));
    return loop;
  };
  const Row outline = ring(0, 0, 4, 40);
  const std::vector<Row> holes = {ring(2, 0, 1, 12), ring(-1, 1.5, 1, 20), ring(-1, -1.5, 0.5, 5)};
  add_planar(surface, outline, holes, surface.patch("face"));
  EXPECT_EQ(surface.points.size(), 77U);
  EXPECT_EQ(surface.triangles.size(), 77U + 2 * 3 - 2);  // Euler: points + 2 holes - 2
  const auto polygon = [](double radius, int n) { return n * radius * radius * std::sin(6.283185307 / n) / 2; };
  EXPECT_NEAR(patch_area(surface, "face"), polygon(4, 40) - polygon(1, 12) - polygon(1, 20) - polygon(0.5, 5), 1e-7);
  EXPECT_EQ(edge_faults(surface).crowded, 0);
  EXPECT_EQ(edge_faults(surface).open, 77);
}

TEST(Planar, StraightBordersMakeNoFlatTriangles) {
  PatchedSurface surface;
  std::vector<int> corners;
  for (const auto& c : {std::pair(0, 0), std::pair(2, 0), std::pair(2, 1), std::pair(1, 1), std::pair(1, 2), std::pair(0, 2)}) {
    corners.push_back(surface.add_point({0, static_cast<double>(c.first), static_cast<double>(c.second)}));
  }
  add_planar(surface, StraightEdges(surface, 5).through(corners), {}, surface.patch("face"));
  EXPECT_NEAR(patch_area(surface, "face"), 3, 1e-12);
  for (int t = 0; t < static_cast<int>(surface.triangles.size()); ++t) EXPECT_GT(least_height(surface, t), 0.05);
}

}  // namespace
}  // namespace strata::shapes
