#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "core/base/context.h"
#include "core/buffer/wrap.h"
#include "core/carve/carve.h"
#include "core/dual/dual.h"
#include "core/features/features.h"
#include "core/fit/fit.h"
#include "core/octree/octree.h"
#include "core/optimise/ground.h"
#include "core/sizing/size_field.h"
#include "core/surface/locator.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

constexpr double kPi = std::numbers::pi;

// A shape meshed as far as features need: wrapped, on the surface, labelled.
struct Matched {
  std::unique_ptr<Surface> surface;
  std::unique_ptr<Features> features;
  Match result;
  std::vector<Diagnostic> adjustments;
  double size = 0;
};

Matched matched(TriangleSoup soup, double cells, FeatureOptions options = {}) {
  Context context;
  Matched m;
  m.surface = std::make_unique<Surface>(condition(std::move(soup), context));
  const Surface& surface = *m.surface;
  m.features = std::make_unique<Features>(detect_features(surface, options, context));
  SizeOptions sizes;
  sizes.max_size = m.size = surface.box.extent().maxCoeff() / cells;
  sizes.patch_size.assign(surface.patch_names.size(), std::numeric_limits<double>::infinity());
  const SizeField field = make_size_field(surface, *m.features, sizes, context);
  const Locator locator(surface);
  HexMesh mesh = carve(dualize(refine_octree(surface, field, OctreeOptions{}, context), context), surface, locator, {}, context).mesh;
  const Ground ground(surface, *m.features);
  mesh = fit_to_smooth(wrap_surface(std::move(mesh), context), ground, surface, false, context).mesh;
  m.result = match_features(std::move(mesh), ground, {}, context);
  report_softened(m.result.softened, ground, context);
  m.adjustments = context.adjustments();
  return m;
}

// Charts on either side of the mesh edges between different charts.
std::map<std::pair<VertexId, VertexId>, std::vector<ChartId>> chart_borders(const HexMesh& mesh) {
  std::map<std::pair<VertexId, VertexId>, std::vector<ChartId>> edges;
  for (QuadId q : mesh.quads.ids())
    for (std::size_t k = 0; k < 4; ++k) edges[std::minmax(mesh.quads[q][k], mesh.quads[q][(k + 1) & 3])].push_back(mesh.chart[q]);
  std::erase_if(edges, [](const auto& e) { return e.second.size() == 2 && e.second[0] == e.second[1]; });
  return edges;
}

std::size_t corners_held(const Matched& m) {
  std::set<std::int32_t> corners;
  for (const Attachment& a : m.result.mesh.attachment)
    if (a.hold == Hold::Corner) corners.insert(a.of);
  return corners.size();
}

std::size_t curves_held(const Matched& m) {
  std::set<std::int32_t> curves;
  for (const Attachment& a : m.result.mesh.attachment)
    if (a.hold == Hold::Curve) curves.insert(a.of);
  return curves.size();
}

// Wherever two charts meet there is a curve or a corner, and each chart keeps most of its area (the staircase still cuts ridges off).
void expect_sound_labels(const Matched& m) {
  const HexMesh& mesh = m.result.mesh;
  for (const auto& [edge, charts] : chart_borders(mesh))
    for (VertexId v : {edge.first, edge.second}) EXPECT_GE(mesh.attachment[v].hold, Hold::Curve);
  IdMap<ChartId, double> wanted(m.features->chart_count(), 0.0), found(m.features->chart_count(), 0.0);
  for (TriangleId t : m.surface->triangles.ids()) {
    const auto [a, b, c] = m.surface->corners(t);
    wanted[m.features->chart[t]] += 0.5 * (b - a).cross(c - a).norm();
  }
  for (QuadId q : mesh.quads.ids()) {
    const auto& v = mesh.quads[q];
    found[mesh.chart[q]] += 0.5 * (mesh.position[v[2]] - mesh.position[v[0]]).cross(mesh.position[v[3]] - mesh.position[v[1]]).norm();
    EXPECT_EQ(mesh.patch[q], m.features->patch_of_chart[mesh.chart[q]]);
  }
  for (ChartId c : wanted.ids()) EXPECT_NEAR(found[c], wanted[c], 0.5 * wanted[c] + m.size * m.size) << "chart " << c.value;
}

TEST(MatchFeatures, EveryCurveAndCornerOfACubeIsHeldWhateverWayItIsTurned) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 4; ++i) {
    const Vec3 axis = Vec3(uniform(random), uniform(random), uniform(random)).normalized();
    const Matched m = matched(test::rotated(test::cube(2), axis, kPi * uniform(random)), 9);
    EXPECT_TRUE(m.result.softened.empty());
    EXPECT_EQ(corners_held(m), 8u);
    EXPECT_EQ(curves_held(m), 12u);
    expect_sound_labels(m);
  }
}

TEST(MatchFeatures, AnLBlockKeepsItsNotch) {
  const Matched m = matched(test::rotated(test::l_block(2), Vec3(1, 2, 3).normalized(), 0.4), 12);
  EXPECT_TRUE(m.result.softened.empty());
  EXPECT_EQ(corners_held(m), 12u);
  EXPECT_EQ(curves_held(m), 18u);
  expect_sound_labels(m);
}

TEST(MatchFeatures, ClosedCurvesOfACylinderAreHeldAllTheWayRound) {
  const Matched m = matched(test::cylinder(), 10);
  EXPECT_TRUE(m.result.softened.empty());
  EXPECT_EQ(curves_held(m), 2u);
  expect_sound_labels(m);
  // Borders between charts are closed: every vertex of them has two border edges.
  std::map<VertexId, int> valence;
  for (const auto& [edge, charts] : chart_borders(m.result.mesh)) ++valence[edge.first], ++valence[edge.second];
  for (const auto& [v, n] : valence) EXPECT_EQ(n, 2);
}

// On a regular polygon of radius 1.
TriangleSoup pyramid(std::int32_t sides, double height) {
  TriangleSoup soup;
  soup.points = {Vec3(0, 0, height), Vec3::Zero()};
  for (std::int32_t i = 0; i < sides; ++i) {
    soup.points.emplace_back(std::cos(2 * kPi * i / sides), std::sin(2 * kPi * i / sides), 0);
    const std::int32_t a = 2 + i, b = 2 + (i + 1) % sides;
    soup.triangles.push_back({0, a, b});
    soup.triangles.push_back({1, b, a});
  }
  soup.patch_names = {"surface"};
  soup.patch.assign(soup.triangles.size(), 0);
  return soup;
}

TEST(MatchFeatures, ACornerOfMoreCurvesThanAVertexHasEdgesShowsThemAll) {
  for (const double angle : {0.1, 0.5}) {
    const Matched m = matched(test::rotated(pyramid(8, 1), Vec3(1, 2, 3).normalized(), angle), 20, {.ridge_angle = kPi / 7});
    EXPECT_EQ(m.features->curves.size(), 16u);
    EXPECT_TRUE(m.result.softened.empty());
    EXPECT_EQ(curves_held(m), 16u);
    EXPECT_EQ(corners_held(m), 9u);
    expect_sound_labels(m);
  }
}

TEST(MatchFeatures, TheCurvesOfASpikeAreHeldThoughTheCellsEndShortOfItsTip) {
  const Matched m = matched(test::rotated(pyramid(3, 2), Vec3(1, 2, 3).normalized(), 0.5), 20);
  EXPECT_TRUE(m.result.softened.empty());
  EXPECT_EQ(curves_held(m), 6u);
  EXPECT_EQ(corners_held(m), 4u);
}

TEST(MatchFeatures, TheTipOfAConeIsACornerOfTheMesh) {
  const Matched m = matched(test::cone(), 10);
  EXPECT_TRUE(m.result.softened.empty());
  EXPECT_EQ(corners_held(m), m.features->corners.size());
  EXPECT_EQ(corners_held(m), 1u);
  expect_sound_labels(m);
}

TEST(MatchFeatures, ACreaseSmallerThanACellIsLeftOutAndReportedInOneDiagnosticWithItsPlace) {
  // A pyramid no wider than a third of a cell stands on a large cube.
  TriangleSoup soup = test::cube(30);
  soup.patch_names = {"surface"};
  soup.patch.assign(soup.triangles.size(), 0);
  Vec3 peak = Vec3::Zero();
  for (Vec3& p : soup.points)
    if ((p - Vec3(0.5, 0.5, 1)).norm() < 1e-6) p.z() += 0.06, peak = p;
  const Matched m = matched(std::move(soup), 8);
  EXPECT_FALSE(m.result.softened.empty());
  EXPECT_EQ(corners_held(m), 8u);
  EXPECT_EQ(curves_held(m), 12u);
  expect_sound_labels(m);
  int reports = 0;
  for (const Diagnostic& d : m.adjustments) {
    if (d.reason != Reason::FeatureSoftened) continue;
    ++reports;
    EXPECT_EQ(d.count, static_cast<std::int64_t>(m.result.softened.size()));
    EXPECT_LT((d.box.min - peak).norm(), 0.2);
    EXPECT_LT((d.box.max - peak).norm(), 0.2);
  }
  EXPECT_EQ(reports, 1);
}

TEST(MatchFeatures, BothEdgesOfAChamferAboutACellWideAreHeldAllTheWayRound) {
  for (const double chamfer : {0.14, 0.2, 0.3}) {  // cells of 0.2
    const Matched m = matched(test::rotated(test::chamfered_cylinder(chamfer), Vec3(1, 2, 3).normalized(), 0.5), 10);
    EXPECT_TRUE(m.result.softened.empty()) << "chamfer of " << chamfer;
    EXPECT_EQ(curves_held(m), 3u) << "chamfer of " << chamfer;
  }
}

TEST(MatchFeatures, AStepFarLowerThanACellIsNoCreaseAndTheFacesRoundItStayApart) {
  const Matched m = matched(test::rotated(test::stepped_cube(0.002), Vec3(3, 2, 1).normalized(), 0.4), 10);
  EXPECT_EQ(m.result.softened.size(), 4u) << "two edges of the step, two across it";
  EXPECT_EQ(corners_held(m), 8u);
  std::set<ChartId> shown(m.result.mesh.chart.begin(), m.result.mesh.chart.end());
  EXPECT_EQ(shown.size(), 6u) << "the cube's faces";
}

TEST(MatchFeatures, OneEdgeOfAStepStaysWhereItIsNotSoLow) {
  const Matched m = matched(test::stepped_cube(0.01), 10);
  EXPECT_EQ(m.result.softened.size(), 3u) << "one edge of the step, two across it";
}

}  // namespace
}  // namespace strata
