#include "core/sheets/insert_sheet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "core/mesh/adjacency.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"

namespace strata {
namespace {

using testing::check_topology;
using testing::grid;

SheetRequest under_charts(const HexMesh& mesh, const std::vector<int>& charts) {
  SheetRequest request;
  request.inner.assign(mesh.hexes.size(), 1);
  const IdMap<QuadId, QuadSides> sides = quad_sides(mesh);
  for (QuadId q : mesh.quads.ids())
    if (std::count(charts.begin(), charts.end(), mesh.chart[q].value) > 0) request.faces.push_back({sides[q].back, sides[q].back_face});
  return request;
}

HexMesh grow(HexMesh mesh, const std::vector<int>& charts, int layers) {
  for (int i = 0; i < layers; ++i) {
    const SheetRequest request = under_charts(mesh, charts);
    EXPECT_TRUE(pinched_vertices(mesh, request).empty());
    mesh = insert_sheet(std::move(mesh), request).mesh;
    EXPECT_EQ(check_topology(mesh), "");
  }
  return mesh;
}

struct CubeCase {
  const char* name;
  std::vector<std::vector<int>> groups;
  std::size_t hexes;
};
class CubeCounts : public ::testing::TestWithParam<CubeCase> {};

TEST_P(CubeCounts, ThreeLayersOnA4x4x4CubeGiveTheCountOfTheFormula) {
  HexMesh mesh = grid(4, 4, 4);
  for (const auto& group : GetParam().groups) mesh = grow(std::move(mesh), group, 3);
  EXPECT_EQ(mesh.hexes.size(), GetParam().hexes);
  EXPECT_EQ(testing::euler_of_boundary(mesh), 2);
  std::int64_t labelled = 0;
  for (int c = 0; c < 6; ++c) labelled += testing::quads_labelled(mesh, ChartId(c));
  EXPECT_EQ(labelled, static_cast<std::int64_t>(mesh.quads.size()));
}

INSTANTIATE_TEST_SUITE_P(Sheets, CubeCounts,
                         ::testing::Values(CubeCase{"OneGroupEverywhere", {{0, 1, 2, 3, 4, 5}}, 352},
                                           CubeCase{"SixGroups", {{0}, {1}, {2}, {3}, {4}, {5}}, 1000},
                                           CubeCase{"ThreeGroupsRoundACorner", {{0}, {2}, {4}}, 343},
                                           CubeCase{"OneFaceImprintedOnItsNeighbours", {{0}}, 112},
                                           CubeCase{"TwoGroupsCrossing", {{0}, {2}}, 196}),
                         [](const auto& tested) { return tested.param.name; });

TEST(InsertSheet, StripsTakeTheNeighboursLabelWhenLayersAreImprinted) {
  const HexMesh mesh = grow(grid(4, 4, 4), {0}, 3);
  EXPECT_EQ(testing::quads_labelled(mesh, ChartId(0)), 16);
  EXPECT_EQ(testing::quads_labelled(mesh, ChartId(1)), 16);
  for (int side = 2; side < 6; ++side) EXPECT_EQ(testing::quads_labelled(mesh, ChartId(side)), 16 + 4 * 3);
}

TEST(InsertSheet, NewHexesPointFromTheFaceIntoTheInnerHex) {
  const HexMesh before = grid(2, 2, 2);
  const SheetRequest request = under_charts(before, {4});
  const SheetInsertion done = insert_sheet(before, request);
  for (std::size_t i = 0; i < request.faces.size(); ++i) {
    const HexId h(done.sheet.first_hex.index() + i);
    const auto& hex = done.mesh.hexes[h];
    const QuadVertices face = face_vertices(before.hexes[request.faces[i].hex], request.faces[i].face);
    for (std::size_t c = 0; c < 4; ++c) {
      EXPECT_NE(std::find(face.begin(), face.end(), hex[c]), face.end());
      EXPECT_EQ(done.sheet.inner_copy[hex[c]], hex[c + 4]);
    }
    EXPECT_EQ(face_vertices(hex, 0)[0], face[0]);
  }
}

TEST(InsertSheet, AThickenedSheetIsPositive) {
  const HexMesh before = grid(3, 3, 3);
  const SheetRequest request = under_charts(before, {0, 1, 2, 3, 4, 5});
  SheetInsertion done = insert_sheet(before, request);
  for (VertexId v : before.position.ids())
    if (done.sheet.inner_copy[v].valid()) done.mesh.position[v] += 0.3 * (before.position[v] - Vec3::Constant(1.5));
  EXPECT_EQ(testing::check_positive(done.mesh), "");
}

TEST(InsertSheet, RandomSolidsStayConformingWithRandomLabelsInAnyOrder) {
  std::mt19937 random(7);
  int inserted = 0, refused = 0;
  for (int round = 0; round < 60; ++round) {
    HexMesh mesh = testing::random_solid(4, random);
    // Random connected labels: each quad takes the label of the nearest of a few random seeds.
    const int patches = 2 + static_cast<int>(random() % 6);
    std::vector<Vec3> seeds;
    std::uniform_real_distribution<double> coordinate(0, 4);
    for (int i = 0; i < patches; ++i) seeds.emplace_back(coordinate(random), coordinate(random), coordinate(random));
    for (QuadId q : mesh.quads.ids()) {
      Vec3 centre = Vec3::Zero();
      for (VertexId v : mesh.quads[q]) centre += 0.25 * mesh.position[v];
      int best = 0;
      for (int i = 1; i < patches; ++i)
        if ((seeds[static_cast<std::size_t>(i)] - centre).norm() < (seeds[static_cast<std::size_t>(best)] - centre).norm()) best = i;
      mesh.chart[q] = ChartId(best);
      mesh.patch[q] = PatchId(best);
    }
    const std::int64_t euler = testing::euler_of_boundary(mesh);
    std::vector<int> order(static_cast<std::size_t>(patches));
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random);
    for (int group : order) {
      const int layers = 1 + static_cast<int>(random() % 3);
      for (int i = 0; i < layers; ++i) {
        const SheetRequest request = under_charts(mesh, {group});
        if (request.faces.empty()) break;
        if (!pinched_vertices(mesh, request).empty()) {
          ++refused;
          break;
        }
        const std::size_t hexes = mesh.hexes.size();
        const std::int64_t own = testing::quads_labelled(mesh, ChartId(group));
        mesh = insert_sheet(std::move(mesh), request).mesh;
        ++inserted;
        ASSERT_EQ(check_topology(mesh), "") << "round " << round;
        ASSERT_EQ(mesh.hexes.size(), hexes + request.faces.size());
        ASSERT_EQ(testing::quads_labelled(mesh, ChartId(group)), own);
        ASSERT_EQ(testing::euler_of_boundary(mesh), euler);
      }
    }
  }
  EXPECT_GT(inserted, 300);
  EXPECT_LT(refused, inserted / 4);
}

TEST(InsertSheet, RoundRandomHexesInsideStaysConformingWithEitherStripRule) {
  std::mt19937 random(11);
  int inserted = 0;
  for (int round = 0; round < 200; ++round) {
    HexMesh mesh = testing::random_solid(4, random);
    SheetRequest request;
    request.strip = round % 2 == 0 ? StripTakes::Inner : StripTakes::Outer;
    request.inner.assign(mesh.hexes.size(), 0);
    // The hexes in a random ball.
    std::uniform_real_distribution<double> coordinate(0, 4);
    const Vec3 centre(coordinate(random), coordinate(random), coordinate(random));
    const double radius = 0.8 + 0.4 * coordinate(random);
    for (HexId h : mesh.hexes.ids()) {
      const Vec3 middle = mesh.position[mesh.hexes[h][0]] + Vec3::Constant(0.5);
      request.inner[h] = (middle - centre).norm() < radius;
    }
    request.faces = faces_between(mesh, request.inner);
    if (request.faces.empty() || !pinched_vertices(mesh, request).empty()) continue;
    ++inserted;
    mesh = insert_sheet(std::move(mesh), request).mesh;
    ASSERT_EQ(check_topology(mesh), "");
    for (ChartId c : mesh.chart) ASSERT_TRUE(c.valid());
  }
  EXPECT_GT(inserted, 60);
}

TEST(InsertSheet, CrossingAnInterfaceKeepsTheInterfaceClosed) {
  // Two regions side by side; the sheet cuts off the lower half of both.
  HexMesh mesh = testing::grid_of_regions(4, 2, 4, [](int x, int, int) { return x < 2 ? 0 : 1; });
  SheetRequest request;
  request.inner.assign(mesh.hexes.size(), 0);
  for (HexId h : mesh.hexes.ids()) request.inner[h] = mesh.position[mesh.hexes[h][0]].z() < 1.5;
  request.faces = faces_between(mesh, request.inner);
  ASSERT_EQ(request.faces.size(), 8U);
  ASSERT_TRUE(pinched_vertices(mesh, request).empty());
  mesh = insert_sheet(std::move(mesh), request).mesh;
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::quads_labelled(mesh, ChartId(6)), 8 + 2);
}

TEST(InsertSheet, EitherSideOfAnInterfaceCanBeLined) {
  for (int side : {0, 1}) {
    HexMesh mesh =
        testing::grid_of_regions(4, 4, 4, [](int x, int y, int z) { return x > 0 && x < 3 && y > 0 && y < 3 && z > 0 && z < 3 ? 1 : 0; });
    SheetRequest request;
    request.inner.assign(mesh.hexes.size(), 0);
    for (HexId h : mesh.hexes.ids()) request.inner[h] = mesh.region[h] == RegionId(side);
    request.faces = faces_between(mesh, request.inner);
    ASSERT_TRUE(pinched_vertices(mesh, request).empty());
    const std::int64_t before = testing::quads_labelled(mesh, ChartId(6));
    mesh = insert_sheet(std::move(mesh), request).mesh;
    EXPECT_EQ(check_topology(mesh), "");
    EXPECT_EQ(testing::quads_labelled(mesh, ChartId(6)), before);
    EXPECT_EQ(mesh.hexes.size(), 64U + 24U);
  }
}

TEST(PinchedVertices, AreFoundWhereTwoRunsMeetAtAVertex) {
  HexMesh mesh = grid(4, 4, 2);
  // On the top, two quads that touch at one vertex only.
  SheetRequest request;
  request.inner.assign(mesh.hexes.size(), 1);
  for (HexId h : mesh.hexes.ids()) {
    const Vec3& p = mesh.position[mesh.hexes[h][0]];
    if (p.z() == 1 && ((p.x() == 1 && p.y() == 1) || (p.x() == 2 && p.y() == 2))) request.faces.push_back({h, 1});
  }
  ASSERT_EQ(request.faces.size(), 2U);
  const auto pinched = pinched_vertices(mesh, request);
  ASSERT_EQ(pinched.size(), 1U);
  EXPECT_EQ(mesh.position[pinched[0]], Vec3(2, 2, 2));
}

TEST(PinchedVertices, AreFoundWhereAFaceToOpenIsMissing) {
  HexMesh mesh = grid(3, 3, 3);
  SheetRequest request;
  request.inner.assign(mesh.hexes.size(), 0);
  request.inner[HexId(13)] = 1;  // the middle one
  request.faces = faces_between(mesh, request.inner);
  ASSERT_EQ(request.faces.size(), 6U);
  EXPECT_TRUE(pinched_vertices(mesh, request).empty());
  request.faces.pop_back();
  EXPECT_FALSE(pinched_vertices(mesh, request).empty());
}

}  // namespace
}  // namespace strata
