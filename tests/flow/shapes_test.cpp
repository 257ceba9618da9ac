// The whole door on small shapes without layers: valid meshes of the right volume, with patches and features kept.
#include <algorithm>
#include <random>

#include "tests/flow/flow.h"

namespace strata::testing {
namespace {

using namespace test;  // shapes

constexpr double kVolumeTolerance = 0.02;
constexpr double kAreaTolerance = 0.03;
constexpr double kCornerFraction = 1e-6;  // of the diagonal

void expect_volume(const Outcome& outcome, double wanted) { EXPECT_NEAR(meshed_volume(outcome), wanted, kVolumeTolerance * wanted); }
void expect_corner(const Outcome& outcome, const Vec3& p, double diagonal) {
  EXPECT_LT(distance_to_vertices(outcome, p), kCornerFraction * diagonal) << p.transpose();
}
// Each side of a border is a polyline between the same ends: never longer than the curve by more than rounding, hardly shorter.
void expect_border(const Outcome& outcome, const std::string& a, const std::string& b, double length) {
  EXPECT_NEAR(border_length(outcome, a, b), length, 0.01 * length) << a << " | " << b;
}

const std::vector<std::string> kBoxSides{"x_min", "x_max", "y_min", "y_max", "z_min", "z_max"};

void expect_box(const Outcome& outcome, const TriangleSoup& soup, const std::array<Vec3, 8>& corners) {
  expect_sound(outcome);
  expect_volume(outcome, volume_of(soup));
  expect_patches_kept(outcome, soup, kAreaTolerance);
  for (const Vec3& p : corners) expect_corner(outcome, p, diagonal_of(soup));
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i + 1; j < 6; ++j)
      if (i / 2 != j / 2) expect_border(outcome, kBoxSides[i], kBoxSides[j], std::cbrt(volume_of(soup)));
}

std::array<Vec3, 8> unit_corners(const Mat3& turn = Mat3::Identity()) {
  std::array<Vec3, 8> p;
  for (int i = 0; i < 8; ++i) p[static_cast<std::size_t>(i)] = turn * Vec3(i & 1, (i >> 1) & 1, i >> 2);
  return p;
}

TEST(Flow, ACubeIsMeshedWithItsCornersEdgesAndSides) {
  const TriangleSoup soup = cube(4);
  const Outcome outcome = run(soup, sized(0.1));
  expect_box(outcome, soup, unit_corners());
  EXPECT_EQ(outcome.rung, Rung::Full);
  EXPECT_NEAR(meshed_volume(outcome), 1, 1e-9) << "flat sides are met exactly";
}

class RotatedCube : public ::testing::TestWithParam<unsigned> {};
TEST_P(RotatedCube, IsMeshedWithItsCornersEdgesAndSides) {
  std::mt19937 random(GetParam());
  std::normal_distribution<double> any;
  const Vec3 axis(any(random), any(random), any(random));
  const double angle = any(random);
  const TriangleSoup soup = rotated(cube(4), axis, angle);
  for (const MeshSpec& spec : {sized(0.1), along_input(sized(0.1))}) {
    const Outcome outcome = run(soup, spec);
    expect_box(outcome, soup, unit_corners(Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix()));
  }
}
INSTANTIATE_TEST_SUITE_P(Seeds, RotatedCube, ::testing::Values(1U, 2U, 3U, 4U));

// Cells turn with the part.
TEST(Flow, APartThatStandsAskewIsMeshedAsWellAsOneThatDoesNot) {
  const Outcome upright = run(l_block(4), sized(0.1));
  const TriangleSoup soup = rotated(l_block(4), Vec3(1, 2, 3), 0.7);
  const Outcome askew = run(soup, sized(0.1));
  expect_sound(askew);
  expect_volume(askew, 3);
  expect_patches_kept(askew, soup, kAreaTolerance);
  EXPECT_EQ(askew.mesh.hexes.size(), upright.mesh.hexes.size());
  EXPECT_NEAR(askew.quality.all.mean, upright.quality.all.mean, 0.01);
  const Outcome along = run(soup, along_input(sized(0.1)));
  EXPECT_LT(along.quality.all.mean, askew.quality.all.mean - 0.02) << "a box of sizes keeps the input's axes";
}

// About as thin as the cells, on or off the axes.
struct Plate {
  TriangleSoup soup;
  Vec3 size;
  Mat3 turn;
};
Plate plate(unsigned seed, double thickness) {
  std::mt19937 random(seed);
  std::normal_distribution<double> any;
  const Vec3 axis(any(random), any(random), any(random)), size(1, 0.8, thickness);
  const double angle = seed == 0 ? 0.0 : any(random);
  return {rotated(box(Vec3::Zero(), size, 4), axis, angle), size, Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix()};
}
constexpr double kPlateCell = 0.06;

void expect_plate(const Plate& plate) {
  const Outcome outcome = run(plate.soup, along_input(sized(kPlateCell)));
  expect_sound(outcome);
  expect_volume(outcome, volume_of(plate.soup));
  expect_patches_kept(outcome, plate.soup, kAreaTolerance);
  for (const Vec3& p : unit_corners()) expect_corner(outcome, plate.turn * plate.size.cwiseProduct(p), diagonal_of(plate.soup));
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = i + 1; j < 6; ++j)
      if (i / 2 != j / 2) expect_border(outcome, kBoxSides[i], kBoxSides[j], plate.size[static_cast<int>(3 - i / 2 - j / 2)]);
}

TEST(Flow, APlateAsThinAsACellIsMeshedWithItsCornersEdgesAndSides) { expect_plate(plate(0, kPlateCell)); }
TEST(Flow, ATurnedThinPlateIsMeshedWithItsCornersEdgesAndSides) { expect_plate(plate(3, 1.4 * kPlateCell)); }

class TurnedPlate : public ::testing::TestWithParam<unsigned> {};
TEST_P(TurnedPlate, IsKeptWhole) {
  const Plate thin = plate(GetParam(), 1.4 * kPlateCell);
  const Outcome outcome = run(thin.soup, along_input(sized(kPlateCell)));
  expect_sound(outcome);
  EXPECT_NEAR(meshed_volume(outcome), volume_of(thin.soup), 0.05 * volume_of(thin.soup));
}
INSTANTIATE_TEST_SUITE_P(Seeds, TurnedPlate, ::testing::Values(1U, 3U, 5U, 7U, 9U));

TEST(Flow, ASphereIsMeshedWithItsVolume) {
  const TriangleSoup soup = sphere(4);
  const Outcome outcome = run(soup, sized(0.16));
  expect_sound(outcome);
  expect_volume(outcome, volume_of(soup));
  expect_patches_kept(outcome, soup, kAreaTolerance);
  EXPECT_EQ(outcome.rung, Rung::Full);
}

TEST(Flow, ACylinderKeepsItsRims) {
  const TriangleSoup soup = cylinder(64, 2, 8);
  const Outcome outcome = run(soup, sized(0.16));
  expect_sound(outcome);
  expect_volume(outcome, volume_of(soup));
  expect_patches_kept(outcome, soup, kAreaTolerance);
  expect_border(outcome, "side", "cap_bottom", 2 * std::numbers::pi);
  expect_border(outcome, "side", "cap_top", 2 * std::numbers::pi);
}

TEST(Flow, AnLBlockKeepsItsReentrantEdge) {
  const TriangleSoup soup = l_block(4);
  const Outcome outcome = run(soup, sized(0.1));
  expect_sound(outcome);
  expect_volume(outcome, 3);
  expect_patches_kept(outcome, soup, kAreaTolerance);
  expect_border(outcome, "notch_x", "notch_y", 1);
  for (const double z : {0.0, 1.0})
    for (const Vec3& p : {Vec3(0, 0, z), Vec3(2, 0, z), Vec3(2, 1, z), Vec3(1, 1, z), Vec3(1, 2, z), Vec3(0, 2, z)})
      expect_corner(outcome, p, diagonal_of(soup));
}

TEST(Flow, TheFlowAroundASphereInABoxHasBothBoundaries) {
  const TriangleSoup soup = sphere_in_box(3, 6);
  MeshSpec spec = sized(0.35);
  spec.sizing.patches.push_back({{"sphere"}, 0.1});
  spec.volume = {VolumeMode::Points, {Vec3(1.5, 1.5, 1.5)}};
  const Outcome outcome = run(soup, spec);
  expect_sound(outcome);
  expect_volume(outcome, 64 - volume_of(scaled(sphere(3), 0.5)));
  expect_patches_kept(outcome, soup, kAreaTolerance);
  EXPECT_EQ(outcome.quality.regions.size(), 1U);
}

TEST(Flow, AllRegionsOfTwoNestedSpheresAreMeshedAndConform) {
  TriangleSoup outer = sphere(4), inner = scaled(sphere(3), 0.5);
  outer.patch_names = {"outer"};
  inner.patch_names = {"inner"};
  const double core = volume_of(inner), all = volume_of(outer);
  const TriangleSoup soup = joined(outer, inner);
  MeshSpec spec = sized(0.2);
  spec.sizing.patches.push_back({{"inner"}, 0.08});
  const Outcome outcome = run(soup, spec);
  expect_sound(outcome);
  ASSERT_EQ(outcome.quality.regions.size(), 2U);
  std::vector<double> volumes{outcome.quality.regions[0].volume, outcome.quality.regions[1].volume};
  std::sort(volumes.begin(), volumes.end());
  EXPECT_NEAR(volumes[0], core, kVolumeTolerance * core);
  EXPECT_NEAR(volumes[1], all - core, kVolumeTolerance * all);
  expect_patches_kept(outcome, soup, kAreaTolerance);
}

TEST(Flow, TwoCubesThatShareASideShareItsQuads) {
  const TriangleSoup soup = touching_cubes(4);
  const Outcome outcome = run(soup, sized(0.15));
  expect_sound(outcome);
  ASSERT_EQ(outcome.quality.regions.size(), 2U);
  for (const RegionStatistics& r : outcome.quality.regions) EXPECT_NEAR(r.volume, 1, kVolumeTolerance);
}

TEST(Flow, ATorusKeepsItsHole) {
  const TriangleSoup soup = torus(1, 0.4, 64, 32);
  const Outcome outcome = run(soup, sized(0.1));
  expect_sound(outcome);
  expect_volume(outcome, volume_of(soup));
  expect_patches_kept(outcome, soup, kAreaTolerance);
}

TEST(Flow, AConeKeepsItsTip) {
  const TriangleSoup soup = cone(64, 2, 8);
  const Outcome outcome = run(soup, sized(0.14));
  expect_sound(outcome);
  expect_volume(outcome, volume_of(soup));
  expect_patches_kept(outcome, soup, kAreaTolerance);
  expect_border(outcome, "side", "base", 2 * std::numbers::pi);
  expect_corner(outcome, Vec3(0, 0, 2), diagonal_of(soup));
}

TEST(Flow, AWedgeOfFortyDegreesKeepsItsEdge) {
  const TriangleSoup soup = sharp_wedge(40 * kDegree, 6);
  const Outcome outcome = run(soup, sized(0.06));
  expect_sound(outcome);
  expect_volume(outcome, volume_of(soup));
  expect_patches_kept(outcome, soup, kAreaTolerance);
  expect_border(outcome, "lower", "upper", 1);
}

// Within what a fillet of about half a cell leaves of the edge, and with better hexes than the exact edge allows.
TEST(Flow, AWedgeOfTwentyDegreesIsRoundedWhereAsked) {
  const double angle = 20 * kDegree, size = 0.06;
  TriangleSoup soup = sharp_wedge(angle, 6);
  soup.patch_names = {"surface"};
  soup.patch.assign(soup.triangles.size(), 0);
  MeshSpec spec = sized(size);
  const Outcome exact = run(soup, spec);
  spec.features.sharp_edges = SharpEdges::Fillet;
  const Outcome outcome = run(soup, spec);
  expect_sound(outcome);
  const double tip = 0.5 * size * (1 / std::sin(0.5 * angle) - 1);
  const double cut = 0.5 * std::sin(angle) * tip * tip;  // the triangle beyond a fillet's centre bounds what it takes
  EXPECT_NEAR(meshed_volume(outcome), volume_of(soup), 2 * cut + kVolumeTolerance * volume_of(soup));
  EXPECT_GT(outcome.quality.all.min, exact.quality.all.min);
  EXPECT_LE(outcome.rung, Rung::FeaturesSoftened);  // where the ends of the ridge are thinner than a cell, the curves round them may be
  EXPECT_TRUE(std::any_of(outcome.adjustments.begin(), outcome.adjustments.end(),
                          [](const Diagnostic& d) { return d.reason == Reason::RidgeFilleted; }));
}

TEST(Flow, AFlatPatchBorderIsKept) {
  const TriangleSoup soup = two_patches(8);
  const Outcome outcome = run(soup, sized(0.1));
  expect_sound(outcome);
  expect_patches_kept(outcome, soup, kAreaTolerance);
  expect_border(outcome, "z_max_left", "z_max_right", 1);
}

}  // namespace
}  // namespace strata::testing
