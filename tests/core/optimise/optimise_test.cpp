#include "core/optimise/optimise.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <cmath>
#include <random>

#include "core/base/context.h"
#include "core/mesh/adjacency.h"
#include "core/quality/quality.h"
#include "core/sheets/insert_sheet.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

using testing::corner_jacobians;
using testing::count_not_positive_hexes;
using testing::grid;

void hold_boundary(HexMesh& mesh, Hold hold) {
  for (const QuadVertices& q : mesh.quads)
    for (const VertexId v : q) mesh.attachment[v] = {hold, kWholeSurface};
}

void perturb_inside(HexMesh& mesh, double by, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> noise(-by, by);
  for (const VertexId v : mesh.position.ids())
    if (mesh.attachment[v].hold == Hold::Free) mesh.position[v] += Vec3(noise(random), noise(random), noise(random));
}

// A sheet along the quads chosen; it has no thickness.
template <class Choose>
HexMesh with_sheet(HexMesh mesh, const Choose& choose) {
  SheetRequest request;
  request.inner.assign(mesh.hexes.size(), 1);
  const auto sides = quad_sides(mesh);
  for (const QuadId q : mesh.quads.ids())
    if (choose(q)) request.faces.push_back({sides[q].back, sides[q].back_face});
  SheetInsertion inserted = insert_sheet(std::move(mesh), request);
  for (const VertexId v : inserted.sheet.inner_copy)
    if (v.valid()) inserted.mesh.attachment[v] = {};
  return std::move(inserted.mesh);
}

TEST(Optimise, UntanglesARandomlyPerturbedGrid) {
  HexMesh mesh = grid(20, 20, 20);
  hold_boundary(mesh, Hold::Fixed);
  perturb_inside(mesh, 0.4, 1);
  EXPECT_GT(count_not_positive_hexes(mesh), 800);
  Context context;
  const OptimiseResult result = optimise(std::move(mesh), {}, {}, context);
  EXPECT_EQ(count_not_positive_hexes(result.mesh), 0);
  EXPECT_EQ(count_not_positive_hexes(result.mesh), 0);
  EXPECT_GT(corner_jacobians(result.mesh).min, 0.9) << "a grid in its own box can become nearly perfect";
}

TEST(Optimise, UntanglesForEverySeedAndPower) {
  for (std::uint32_t seed = 2; seed < 8; ++seed) {
    HexMesh mesh = grid(8, 8, 8);
    hold_boundary(mesh, Hold::Fixed);
    perturb_inside(mesh, 0.5, seed);
    Context context;
    OptimiseOptions options;
    options.power = 1.5 * seed;
    EXPECT_EQ(count_not_positive_hexes(optimise(std::move(mesh), {}, options, context).mesh), 0) << "seed " << seed;
  }
}

TEST(Optimise, InflatesASheetWithoutThicknessOverTheWholeBoundary) {
  HexMesh mesh = with_sheet(grid(6, 6, 6), [](QuadId) { return true; });
  hold_boundary(mesh, Hold::Fixed);
  EXPECT_GE(count_not_positive_hexes(mesh), 6 * 36);
  Context context;
  OptimiseOptions options;
  options.sweeps = 30;
  const OptimiseResult result = optimise(std::move(mesh), {}, options, context);
  EXPECT_EQ(count_not_positive_hexes(result.mesh), 0);
  EXPECT_GT(corner_jacobians(result.mesh).min, 0.3);
}

TEST(Optimise, InflatesASheetWithoutThicknessOnOneSide) {
  HexMesh mesh = grid(6, 6, 6);
  const auto chart = mesh.chart;
  mesh = with_sheet(std::move(mesh), [&](QuadId q) { return chart[q] == ChartId(0); });
  hold_boundary(mesh, Hold::Fixed);
  // The inner copies on the rim of the side lie on the neighbouring sides: they may slide on the boundary of the box only. Here: let them
  // move freely but for the outer side, which is enough to open the sheet.
  for (const VertexId v : mesh.position.ids())
    if (mesh.position[v].z() == 0) mesh.attachment[v] = {};
  for (const QuadId q : mesh.quads.ids())
    if (mesh.chart[q] == ChartId(0))
      for (const VertexId v : mesh.quads[q]) mesh.attachment[v] = {Hold::Fixed, -1};
  Context context;
  OptimiseOptions options;
  options.sweeps = 30;
  const OptimiseResult result = optimise(std::move(mesh), {}, options, context);
  EXPECT_EQ(count_not_positive_hexes(result.mesh), 0);
  EXPECT_GT(corner_jacobians(result.mesh).min, 0.3);
}

TEST(Optimise, LeavesAPerfectMeshAlone) {
  HexMesh mesh = grid(5, 4, 3);
  hold_boundary(mesh, Hold::Fixed);
  const HexMesh before = mesh;
  Context context;
  EXPECT_EQ(optimise(std::move(mesh), {}, {}, context).mesh.position, before.position);
}

TEST(Optimise, ValidHexesStayValid) {
  for (std::uint32_t seed = 0; seed < 12; ++seed) {
    std::mt19937 random(seed);
    HexMesh mesh = testing::random_solid(6, random);
    perturb_inside(mesh, 0.45, seed);  // everything is free: boundary too
    std::vector<HexId> valid;
    const auto positive = [](const HexMesh& m, HexId h) {
      std::array<Vec3, 8> p;
      for (std::size_t c = 0; c < 8; ++c) p[c] = m.position[m.hexes[h][c]];
      return corner_scaled_jacobian(p) > 1e-9;
    };
    for (const HexId h : mesh.hexes.ids())
      if (positive(mesh, h)) valid.push_back(h);
    const auto inverted = count_not_positive_hexes(mesh);
    Context context;
    const OptimiseResult result = optimise(std::move(mesh), {}, {}, context);
    for (const HexId h : valid) EXPECT_TRUE(positive(result.mesh, h));
    EXPECT_LE(count_not_positive_hexes(result.mesh), inverted);
  }
}

TEST(Optimise, DoesNotDependOnTheNumberOfThreads) {
  IdMap<VertexId, Vec3> first;
  for (const std::size_t threads : {1u, 2u, 4u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    HexMesh mesh = grid(12, 12, 12);
    hold_boundary(mesh, Hold::Fixed);
    perturb_inside(mesh, 0.35, 9);
    Context context;
    OptimiseResult result = optimise(std::move(mesh), {}, {}, context);
    result = polish(std::move(result.mesh), {}, 0.99, 3, context);
    if (first.empty()) first = result.mesh.position;
    else EXPECT_EQ(result.mesh.position, first) << threads << " threads";
  }
}

TEST(Optimise, ARotatedMeshGivesTheRotatedResult) {
  HexMesh mesh = grid(5, 5, 5);
  hold_boundary(mesh, Hold::Fixed);
  perturb_inside(mesh, 0.3, 12);
  HexMesh turned = mesh;
  const Eigen::AngleAxisd turn(0.8, Vec3(1, 2, 3).normalized());
  for (Vec3& p : turned.position) p = turn * p;
  Context context;
  OptimiseOptions options;
  options.sweeps = 60;
  const HexMesh a = optimise(std::move(mesh), {}, options, context).mesh;
  const HexMesh b = optimise(std::move(turned), {}, options, context).mesh;
  for (const VertexId v : a.position.ids()) EXPECT_LT((turn * a.position[v] - b.position[v]).norm(), 1e-2);
}

TEST(Optimise, OnlyTheVerticesRoundTheSeedsMove) {
  HexMesh mesh = grid(9, 9, 9);
  hold_boundary(mesh, Hold::Fixed);
  perturb_inside(mesh, 0.2, 21);
  const HexMesh before = mesh;
  IdMap<VertexId, std::uint8_t> seeds(mesh.position.size(), 0);
  for (const VertexId v : mesh.position.ids())
    if ((mesh.position[v] - Vec3(5, 5, 5)).norm() < 0.5) seeds[v] = 1;
  OptimiseRequest request;
  request.seeds = &seeds;
  OptimiseOptions options;
  options.rings = 1;
  Context context;
  const HexMesh after = optimise(std::move(mesh), request, options, context).mesh;
  int moved = 0;
  for (const VertexId v : after.position.ids()) {
    if (after.position[v] == before.position[v]) continue;
    ++moved;
    EXPECT_LT((before.position[v] - Vec3(5, 5, 5)).lpNorm<Eigen::Infinity>(), 1.8);
  }
  EXPECT_GT(moved, 20);
}

TEST(Optimise, NeighboursThatAreKeptChangeNothing) {
  HexMesh mesh = grid(9, 9, 9);
  hold_boundary(mesh, Hold::Fixed);
  perturb_inside(mesh, 0.3, 22);
  Neighbours kept(mesh);
  IdMap<VertexId, std::uint8_t> inside(mesh.position.size(), 0);
  for (const VertexId v : mesh.position.ids()) inside[v] = mesh.attachment[v].hold == Hold::Free;
  kept.choose(mesh, inside);
  OptimiseRequest request;
  Context context;
  const HexMesh own = optimise(mesh, request, {}, context).mesh;
  request.neighbours = &kept;
  EXPECT_EQ(optimise(std::move(mesh), request, {}, context).mesh.position, own.position);
}

TEST(Optimise, RectangularTargetsShapeTheHexes) {
  // Two columns of hexes share a box; the lower row of hexes asks to be thin.
  HexMesh mesh = grid(4, 4, 4);
  hold_boundary(mesh, Hold::Fixed);
  for (const VertexId v : mesh.position.ids())
    if (mesh.position[v].z() > 0 && mesh.position[v].z() < 4) mesh.attachment[v] = {};
  IdMap<HexId, HexTarget> targets(mesh.hexes.size(), HexTarget{1, 1, 1});
  for (const HexId h : mesh.hexes.ids())
    if (mesh.position[mesh.hexes[h][6]].z() < 1.5) targets[h] = {1, 1, 0.3f};
  OptimiseRequest request;
  request.targets = &targets;
  OptimiseOptions options;
  options.sweeps = 50;
  Context context;
  const HexMesh after = optimise(mesh, request, options, context).mesh;
  for (const VertexId v : after.position.ids())
    if (mesh.position[v].z() == 1) {
      EXPECT_LT(after.position[v].z(), 0.75);
    }
}

TEST(Polish, RaisesTheWorstAndNeverLowersIt) {
  HexMesh mesh = grid(8, 8, 8);
  hold_boundary(mesh, Hold::Fixed);
  perturb_inside(mesh, 0.25, 30);
  Context context;
  OptimiseOptions options;
  options.sweeps = 1;
  OptimiseResult before = optimise(std::move(mesh), {}, options, context);
  const double first = corner_jacobians(before.mesh).min;
  double last = first;
  HexMesh at = std::move(before.mesh);
  for (int i = 0; i < 3; ++i) {
    OptimiseResult result = polish(std::move(at), {}, 0.95, 2, context);
    EXPECT_GE(corner_jacobians(result.mesh).min, last);
    last = corner_jacobians(result.mesh).min;
    at = std::move(result.mesh);
  }
  EXPECT_GT(last, first);
}

// 2 x 2 x 2 hexes with one free vertex in their middle, `edge` above a neighbour that is raised to `floor`.
HexMesh with_short_edge(double floor, double edge) {
  HexMesh mesh = grid(2, 2, 2);
  hold_boundary(mesh, Hold::Fixed);
  for (Vec3& p : mesh.position)
    if (p == Vec3(1, 1, 0)) p.z() = floor;
    else if (p == Vec3(1, 1, 1)) p.z() = floor + edge;
  return mesh;
}

double height(const HexMesh& mesh) {
  for (const VertexId v : mesh.position.ids())
    if (mesh.attachment[v].hold == Hold::Free) return mesh.position[v].z();
  return 0;
}

TEST(Polish, OpensFlatHexesWhereShapeCounts) {
  constexpr double kFloor = 0.8, kEdge = 0.2;  // angles are as good as they can be
  const auto edge_after = [&](Regard regard) {
    Context context;
    return height(polish(with_short_edge(kFloor, kEdge), {}, 0.95, 4, context, regard).mesh) - kFloor;
  };
  EXPECT_NEAR(edge_after(Regard::Angles), kEdge, 0.05);
  EXPECT_GT(edge_after(Regard::AnglesAndShape), 2 * kEdge);
}

// A box whose lid nothing holds, with a sheet of no thickness along the lid.
HexMesh with_flat_sheet_under_open_lid() {
  HexMesh mesh = grid(6, 6, 3);
  hold_boundary(mesh, Hold::Fixed);
  for (const VertexId v : mesh.position.ids()) {
    const Vec3& p = mesh.position[v];
    if (p.z() > 2.5 && p.x() > 0.5 && p.x() < 5.5 && p.y() > 0.5 && p.y() < 5.5) mesh.attachment[v] = {};
  }
  const IdMap<VertexId, Vec3> at = mesh.position;
  const IdMap<QuadId, QuadVertices> quads = mesh.quads;
  return with_sheet(std::move(mesh),
                    [&](QuadId q) { return std::all_of(quads[q].begin(), quads[q].end(), [&](VertexId v) { return at[v].z() > 2.5; }); });
}

TEST(Optimise, AnOpenSkinThatSlidesKeepsItsVolume) {
  const auto volume_after = [](OpenSkin open_skin) {
    Context context;
    OptimiseRequest request;
    request.open_skin = open_skin;
    OptimiseResult result = optimise(with_flat_sheet_under_open_lid(), request, {}, context);
    EXPECT_EQ(count_not_positive_hexes(result.mesh), 0);
    result = polish(std::move(result.mesh), request, 0.95, 4, context, Regard::AnglesAndShape);
    return testing::hex_volume(result.mesh);
  };
  EXPECT_GT(volume_after(OpenSkin::Moves), 6 * 6 * 3 + 2);
  EXPECT_NEAR(volume_after(OpenSkin::Slides), 6 * 6 * 3, 0.2);
}

TEST(Optimise, StopsWhenCancelled) {
  HexMesh mesh = grid(4, 4, 4);
  const std::atomic<bool> cancel{true};
  Context context(&cancel, {});
  EXPECT_THROW(optimise(std::move(mesh), {}, {}, context), MeshError);
}

}  // namespace
}  // namespace strata
