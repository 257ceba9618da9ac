#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "core/base/context.h"
#include "core/buffer/wrap.h"
#include "core/mesh/adjacency.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"

namespace strata {
namespace {

using testing::check_topology;
using testing::grid;

// Features as the labels have them: a curve per pair of charts that meet, a corner per vertex of three charts or more; vertices attached.
Features features_of_labels(HexMesh& mesh, std::size_t charts) {
  Features features;
  features.patch_of_chart.resize(charts);
  for (ChartId c : features.patch_of_chart.ids()) features.patch_of_chart[c] = PatchId(c.value);
  std::map<std::pair<int, int>, std::set<ChartId>> edges;
  std::map<int, std::set<ChartId>> at;
  for (QuadId q : mesh.quads.ids())
    for (std::size_t i = 0; i < 4; ++i) {
      const int a = mesh.quads[q][i].value, b = mesh.quads[q][(i + 1) & 3].value;
      edges[{std::min(a, b), std::max(a, b)}].insert(mesh.chart[q]);
      at[a].insert(mesh.chart[q]);
    }
  std::map<std::set<ChartId>, CurveId> curve;
  std::map<int, std::set<CurveId>> curves_at;
  for (const auto& [edge, pair] : edges) {
    if (pair.size() < 2) continue;
    if (!curve.contains(pair)) {
      Curve fresh;
      fresh.left = *pair.begin();
      fresh.right = *std::next(pair.begin());
      curve[pair] = features.curves.push_back(fresh);
    }
    curves_at[edge.first].insert(curve[pair]);
    curves_at[edge.second].insert(curve[pair]);
  }
  for (const auto& [v, labels] : at) {
    Attachment& held = mesh.attachment[VertexId(v)];
    if (labels.size() > 2 || (labels.size() == 2 && curves_at[v].size() > 1)) {
      Corner corner;
      corner.curves.assign(curves_at[v].begin(), curves_at[v].end());
      held = {Hold::Corner, features.corners.push_back(corner).value};
    } else if (labels.size() == 2) {
      held = {Hold::Curve, curves_at[v].begin()->value};
    } else {
      held = {Hold::Chart, labels.begin()->value};
    }
  }
  return features;
}

void label(HexMesh& mesh, const std::vector<Vec3>& seeds) {
  for (QuadId q : mesh.quads.ids()) {
    Vec3 centre = Vec3::Zero();
    for (VertexId v : mesh.quads[q]) centre += 0.25 * mesh.position[v];
    int best = 0;
    for (std::size_t i = 1; i < seeds.size(); ++i)
      if ((seeds[i] - centre).norm() < (seeds[static_cast<std::size_t>(best)] - centre).norm()) best = static_cast<int>(i);
    mesh.chart[q] = ChartId(best);
    mesh.patch[q] = PatchId(best);
  }
}

// Attachments say the truth: each corner and each curve's vertices lie where their charts meet.
std::string check_attachments(const HexMesh& mesh, const Features& features) {
  const VertexStars<QuadId> round = quads_round_vertices(mesh);
  std::vector<int> corner_uses(features.corners.size(), 0);
  for (VertexId v : mesh.position.ids()) {
    std::set<ChartId> charts;
    for (QuadId q : round.of(v)) charts.insert(mesh.chart[q]);
    const Attachment& a = mesh.attachment[v];
    const std::string where = "vertex " + std::to_string(v.value);
    if (charts.empty() != (a.hold == Hold::Free)) return where + " is held though inside, or free though on the surface";
    if (a.hold == Hold::Corner) ++corner_uses[static_cast<std::size_t>(a.of)];
    if (a.hold == Hold::Chart && a.of >= 0 && charts != std::set<ChartId>{ChartId(a.of)}) return where + " is not on its chart alone";
    if (a.hold == Hold::Curve) {
      const Curve& curve = features.curves[CurveId(a.of)];
      if (charts != std::set<ChartId>{curve.left, curve.right}) return where + " is not between its curve's charts";
    }
    if (a.hold == Hold::Chart && a.of < 0 && charts.size() < 2) return where + " holds the whole surface though on one chart";
  }
  for (std::size_t c = 0; c < corner_uses.size(); ++c)
    if (corner_uses[c] != 1) return "corner " + std::to_string(c) + " has " + std::to_string(corner_uses[c]) + " vertices";
  return "";
}

TEST(WrapRidges, LeavesAnAlignedCubeAlone) {
  Context context;
  HexMesh before = wrap_surface(grid(4, 4, 4), context);
  const Features features = features_of_labels(before, 6);
  const HexMesh mesh = wrap_ridges(before, features, {}, context);
  EXPECT_EQ(mesh.hexes.size(), before.hexes.size());
}

TEST(WrapRidges, GivesEveryQuadOneBorderEdgeWhereARidgeIsAStaircase) {
  Context context;
  HexMesh mesh = wrap_surface(grid(6, 6, 6), context);
  label(mesh, {Vec3(0, 0.3, 0.9), Vec3(6, 5.2, 5.1)});
  const Features features = features_of_labels(mesh, 2);
  EXPECT_NE(testing::check_one_border_edge_per_quad(mesh), "");
  mesh = wrap_ridges(std::move(mesh), features, {}, context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::check_one_border_edge_per_quad(mesh), "");
  EXPECT_EQ(testing::check_quads_per_hex(mesh, 1), "");
  EXPECT_EQ(check_attachments(mesh, features), "");
  // Where the staircase turns, new quads are straight: the optimiser's work.
  EXPECT_LT(testing::count_not_positive_hexes(mesh), static_cast<std::int64_t>(mesh.hexes.size() / 8));
  EXPECT_TRUE(context.adjustments().empty());
}

// A path on the top of the block that goes in zigzags: one edge along x, one along y, and so on.
std::vector<CreaseEdge> zigzag(const HexMesh& mesh, Vec3 from, int edges, const Vec3& first = Vec3(1, 0, 0),
                               const Vec3& second = Vec3(0, 1, 0), std::int32_t id = 0) {
  const auto at = [&](const Vec3& p) {
    VertexId best(std::size_t{0});
    for (QuadId q : mesh.quads.ids())
      for (VertexId v : mesh.quads[q])
        if ((mesh.position[v] - p).norm() < (mesh.position[best] - p).norm()) best = v;
    return best;
  };
  std::vector<CreaseEdge> path;
  for (int i = 0; i < edges; ++i) {
    const Vec3 to = from + (i % 2 == 0 ? first : second);
    path.push_back({id, at(from), at(to)});
    from = to;
  }
  return path;
}

TEST(WrapRidges, GivesQuadsBesideABentCreaseOneEdgeOnItEach) {
  Context context;
  HexMesh mesh = wrap_surface(grid(8, 8, 4), context);
  label(mesh, {Vec3(4, 4, 4)});
  for (Attachment& a : mesh.attachment)
    if (a.hold != Hold::Free) a = {Hold::Chart, 0};
  for (QuadId q : mesh.quads.ids())
    for (VertexId v : mesh.quads[q]) mesh.attachment[v] = {Hold::Chart, 0};
  Features features;
  features.patch_of_chart.push_back(PatchId(0));
  const std::vector<CreaseEdge> crease = zigzag(mesh, Vec3(2, 2, 4), 6);
  const auto on_path = [&](VertexId a, VertexId b) {
    return std::any_of(crease.begin(), crease.end(), [&](const CreaseEdge& e) { return (e.a == a && e.b == b) || (e.a == b && e.b == a); });
  };
  const auto most_edges = [&](const HexMesh& m) {
    int most = 0;
    for (const QuadVertices& q : m.quads) {
      int edges = 0;
      for (std::size_t k = 0; k < 4; ++k) edges += on_path(q[k], q[(k + 1) & 3]);
      most = std::max(most, edges);
    }
    return most;
  };
  EXPECT_EQ(most_edges(mesh), 2);
  const std::size_t before = mesh.hexes.size();
  mesh = wrap_ridges(std::move(mesh), features, crease, context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::check_quads_per_hex(mesh, 1), "");
  EXPECT_EQ(most_edges(mesh), 1);
  EXPECT_LT(mesh.hexes.size(), before + 100) << "rows run along the crease only";
}

TEST(WrapRidges, RowsBesideTwoCreasesThatMeetDoNotCrowdTheSectorBetween) {
  Context context;
  HexMesh mesh = wrap_surface(grid(10, 10, 4), context);
  label(mesh, {Vec3(5, 5, 4)});
  for (QuadId q : mesh.quads.ids())
    for (VertexId v : mesh.quads[q]) mesh.attachment[v] = {Hold::Chart, 0};
  Features features;
  features.patch_of_chart.push_back(PatchId(0));
  // Both leave the corner into one quad's two edges, and bend on either side.
  const Vec3 corner(5, 5, 4), x = Vec3(1, 0, 0), y = Vec3(0, 1, 0);
  std::vector<CreaseEdge> creases = zigzag(mesh, corner, 4, x, -y, 0);
  const std::vector<CreaseEdge> other = zigzag(mesh, corner, 4, y, -x, 1);
  creases.insert(creases.end(), other.begin(), other.end());
  const VertexId at = creases.front().a;
  ASSERT_EQ(at, other.front().a);
  const auto quads_at_corner = [&] {
    return std::count_if(mesh.quads.begin(), mesh.quads.end(),
                         [&](const QuadVertices& q) { return std::find(q.begin(), q.end(), at) != q.end(); });
  };
  EXPECT_EQ(quads_at_corner(), 4);
  mesh = wrap_ridges(std::move(mesh), features, creases, context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::check_quads_per_hex(mesh, 1), "");
  EXPECT_LE(quads_at_corner(), 4) << "two quads on either side, each with an edge on one of the creases";
}

TEST(WrapRidges, MovesCornersWithTheWrappedChart) {
  Context context;
  HexMesh mesh = wrap_surface(grid(6, 6, 6), context);
  label(mesh, {Vec3(0, 0, 1), Vec3(6, 1, 5), Vec3(2, 6, 3)});
  const Features features = features_of_labels(mesh, 3);
  mesh = wrap_ridges(std::move(mesh), features, {}, context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(check_attachments(mesh, features), "");
  EXPECT_EQ(testing::check_one_border_edge_per_quad(mesh), "");
}

TEST(WrapRidges, KeepsRandomlyLabelledSolidsConforming) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate(0, 5);
  int clean = 0, rounds = 30;
  for (int round = 0; round < rounds; ++round) {
    Context context;
    HexMesh mesh = wrap_surface(round % 2 == 0 ? grid(5, 5, 5) : testing::random_solid(5, random), context);
    std::vector<Vec3> seeds;
    for (int i = 0; i < 2 + round % 5; ++i) seeds.emplace_back(coordinate(random), coordinate(random), coordinate(random));
    label(mesh, seeds);
    const Features features = features_of_labels(mesh, seeds.size());
    mesh = wrap_ridges(std::move(mesh), features, {}, context);
    ASSERT_EQ(check_topology(mesh), "");
    ASSERT_EQ(testing::check_quads_per_hex(mesh, 1), "");
    const std::string wrong = testing::check_one_border_edge_per_quad(mesh);
    if (wrong.empty()) ++clean;
    else EXPECT_FALSE(context.adjustments().empty()) << wrong;
  }
  EXPECT_GT(clean, rounds * 3 / 5);
}

TEST(WrapRidges, ALayerRoundAChartThatCrossesAnInterfaceKeepsBothRegionsClosed) {
  Context context;
  HexMesh mesh = wrap_surface(testing::grid_of_regions(6, 4, 4, [](int x, int, int) { return x < 3 ? 0 : 1; }), context);
  // The outside is cut by a staircase into two charts on either side of the interface.
  for (QuadId q : mesh.quads.ids()) {
    if (mesh.chart[q] == ChartId(6)) {
      mesh.chart[q] = ChartId(4);
      continue;
    }
    Vec3 centre = Vec3::Zero();
    for (VertexId v : mesh.quads[q]) centre += 0.25 * mesh.position[v];
    mesh.chart[q] = ChartId((centre.x() < 3 ? 0 : 2) + (centre.x() * 0.8 + centre.y() + centre.z() < 6.4 ? 0 : 1));
  }
  mesh.patch.assign(mesh.quads.size(), PatchId(0));
  const Features features = features_of_labels(mesh, 5);
  mesh = wrap_ridges(std::move(mesh), features, {}, context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::check_one_border_edge_per_quad(mesh), "");
}

}  // namespace
}  // namespace strata
