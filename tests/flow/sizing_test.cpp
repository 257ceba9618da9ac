// What the size wishes of a specification do to the mesh.
#include <algorithm>
#include <limits>

#include "tests/flow/flow.h"

namespace strata {
namespace {

using testing::expect_sound;
using testing::run;
using testing::sized;

// Mean edge length of the quads whose centre lies within `reach` of where `near` says.
template <class Near>
double mean_edge(const Outcome& outcome, const Near& near) {
  double sum = 0;
  int count = 0;
  for (const QuadVertices& q : outcome.mesh.quads) {
    Vec3 centre = Vec3::Zero();
    for (VertexId v : q) centre += 0.25 * outcome.mesh.position[v];
    if (!near(centre)) continue;
    for (std::size_t k = 0; k < 4; ++k) sum += (outcome.mesh.position[q[k]] - outcome.mesh.position[q[(k + 1) & 3]]).norm(), ++count;
  }
  EXPECT_GT(count, 0);
  return sum / count;
}

TEST(Sizing, CurvesBetweenTwoPatchesAreRefined) {
  MeshSpec spec = sized(0.2);
  spec.sizing.curves.push_back({{"x_min", "z_m*x"}, 0.05});
  const Outcome outcome = run(test::cube(1), spec);
  expect_sound(outcome);
  const double at = mean_edge(outcome, [](const Vec3& p) { return p.x() + 1 - p.z() < 0.06; });
  const double off = mean_edge(outcome, [](const Vec3& p) { return p.x() > 0.9 && p.z() < 0.5; });
  EXPECT_NEAR(at, 0.05, 0.02);
  EXPECT_GT(off, 0.1);
}

TEST(Sizing, ASizeMapRefinesWhereItIsFine) {
  MeshSpec spec = sized(0.2);
  spec.sizing.background = {Vec3(0, 0, 0), Vec3(1, 1, 1), {2, 2, 2}, {0.04, 1, 1, 1, 1, 1, 1, 1}};
  const Outcome outcome = run(test::cube(1), spec);
  expect_sound(outcome);
  EXPECT_LT(mean_edge(outcome, [](const Vec3& p) { return p.norm() < 0.08; }), 0.08);
  EXPECT_GT(mean_edge(outcome, [](const Vec3& p) { return p.minCoeff() > 0.7; }), 0.1);
}

TEST(Sizing, LevelsBoundTheCells) {
  MeshSpec coarse, fine;
  coarse.sizing.min_level = 3;
  fine.sizing.min_level = 4;
  const Outcome a = run(test::cube(1), coarse), b = run(test::cube(1), fine);
  EXPECT_NEAR(mean_edge(a, [](const Vec3&) { return true; }), 1.0 / 8, 0.03);
  EXPECT_NEAR(mean_edge(b, [](const Vec3&) { return true; }), 1.0 / 16, 0.015);
  fine.sizing.max_level = 4;
  fine.sizing.patches.push_back({{"z_max"}, 0.001});
  const Outcome bounded = run(test::cube(1), fine);
  EXPECT_LT(bounded.mesh.hexes.size(), 2 * b.mesh.hexes.size());
}

TEST(Sizing, GradationKeepsCellsSmallFurtherOut) {
  std::size_t before = 0;
  for (const double gradation : {2.0, 1.4, 1.2}) {
    MeshSpec spec = sized(0.25);
    spec.sizing.gradation = gradation;
    spec.sizing.spheres.push_back({Vec3(1, 1, 1), 0.05, 0.03});
    const Outcome outcome = run(test::scaled(test::cube(1), 2), spec);
    expect_sound(outcome);
    EXPECT_GT(outcome.mesh.hexes.size(), before);
    before = outcome.mesh.hexes.size();
  }
}

TEST(Sizing, TheCapOnCellsIsKeptAndTold) {
  MeshSpec spec = sized(0.02);
  spec.sizing.max_cells = 20000;
  const Outcome outcome = run(test::sphere(3), spec);
  expect_sound(outcome);
  EXPECT_LT(outcome.mesh.hexes.size(), 20000U);
  const auto told = [](const Diagnostic& d) { return d.reason == Reason::SizeCoarsened; };
  EXPECT_EQ(std::count_if(outcome.adjustments.begin(), outcome.adjustments.end(), told), 1);
}

std::int64_t estimated(TriangleSoup soup, const MeshSpec& spec) {
  Context context;
  return check_request(std::move(soup), spec, context).estimate.hexes;
}

TEST(Sizing, CheckCountsTheHexesOfSmoothShapesExactly) {
  for (const TriangleSoup& soup : {test::sphere(3), test::torus(), test::sphere_in_box(3)}) {
    const MeshSpec spec = sized(0.3);
    const std::int64_t counted = estimated(soup, spec);
    const auto made = static_cast<std::int64_t>(run(soup, spec).mesh.hexes.size());
    if (soup.patch_names.size() == 1) {
      EXPECT_EQ(counted, made);
    } else {
      EXPECT_NEAR(static_cast<double>(counted), static_cast<double>(made), 0.1 * static_cast<double>(made));
    }
  }
}

TEST(Sizing, CheckCountsLayers) {
  const MeshSpec plain = sized(0.3), spec = testing::with_layers(plain, testing::layers_of({"*"}, 3, 0.01));
  const auto made = static_cast<double>(run(test::sphere(3), spec).mesh.hexes.size());
  EXPECT_NEAR(static_cast<double>(estimated(test::sphere(3), spec)), made, 0.01 * made);
}

// What admission goes by, against what was made: hexes made over hexes estimated.
double made_over_estimated(const TriangleSoup& soup, const MeshSpec& spec) {
  double estimated = 0;
  Context context;
  Observer observer;
  observer.on_estimate = [&](const Estimate& estimate) { estimated = static_cast<double>(estimate.hexes); };
  return static_cast<double>(generate(soup, spec, context, observer).mesh.hexes.size()) / estimated;
}

TEST(Sizing, TheEstimateOfTheOctreeLiesWithinItsBand) {
  for (const TriangleSoup& soup : {test::sphere(3), test::cube(2)}) {
    const MeshSpec plain = sized(0.05);
    for (const MeshSpec& spec : {plain, testing::with_layers(plain, testing::layers_of({"*"}, 4, 0.01))}) {
      const double ratio = made_over_estimated(soup, spec);
      EXPECT_GT(ratio, 0.6) << soup.patch_names.size() << " patches, layers " << spec.layers.size();
      EXPECT_LT(ratio, 1.5) << soup.patch_names.size() << " patches, layers " << spec.layers.size();
    }
  }
}

TEST(Sizing, CheckCountsTheLayersThatLeadOverToTheVolume) {
  MeshSpec spec = testing::with_layers(sized(0.2), testing::layers_of({"*"}, 2, 0.005));
  spec.layers[0].blending = Blending::Auto;
  const auto made = static_cast<double>(run(test::sphere(3), spec).mesh.hexes.size());
  EXPECT_NEAR(static_cast<double>(estimated(test::sphere(3), spec)), made, 0.15 * made);
}

}  // namespace
}  // namespace strata
