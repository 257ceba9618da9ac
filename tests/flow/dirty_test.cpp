// Surfaces with random damage: a sound mesh or a refusal that names the defect, nothing else.
#include <algorithm>
#include <random>

#include "tests/flow/flow.h"

namespace strata {
namespace {

double uniform(std::mt19937& random, double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
std::size_t below(std::mt19937& random, std::size_t count) { return random() % count; }

TriangleSoup random_shape(std::mt19937& random) {
  const std::vector<TriangleSoup> shapes{test::cube(3),          test::cylinder(24, 2, 3),     test::cone(24),
                                         test::l_block(),        test::torus(1, 0.35, 24, 12), test::sphere(2),
                                         test::sharp_wedge(0.6), test::touching_cubes(2)};
  return test::rotated(shapes[below(random, shapes.size())], Vec3(uniform(random, -1, 1), uniform(random, -1, 1), 1),
                       uniform(random, 0, 3));
}

void drop_triangle(TriangleSoup& soup, std::size_t t) {
  soup.triangles.erase(soup.triangles.begin() + static_cast<std::ptrdiff_t>(t));
  soup.patch.erase(soup.patch.begin() + static_cast<std::ptrdiff_t>(t));
}

void add_triangle(TriangleSoup& soup, const std::array<std::int32_t, 3>& triangle) {
  soup.triangles.push_back(triangle);
  soup.patch.push_back(0);
}

void damage(TriangleSoup& soup, std::mt19937& random) {
  const auto any_triangle = [&] { return below(random, soup.triangles.size()); };
  const auto any_point = [&] { return static_cast<std::int32_t>(below(random, soup.points.size())); };
  switch (below(random, 7)) {
    case 0: drop_triangle(soup, any_triangle()); break;
    case 1: add_triangle(soup, std::array(soup.triangles[any_triangle()])); break;
    case 2: std::swap(soup.triangles[any_triangle()][0], soup.triangles[any_triangle()][1]); break;
    case 3: soup.points[static_cast<std::size_t>(any_point())] *= uniform(random, -0.5, 2); break;
    case 4: add_triangle(soup, {any_point(), any_point(), any_point()}); break;
    case 5: soup = test::joined(soup, test::shifted(random_shape(random), Vec3(uniform(random, -1, 1), 0.3, 0.2))); break;
    default: soup = test::jittered(std::move(soup), uniform(random, 0, 0.05), static_cast<std::uint32_t>(random())); break;
  }
}

void run_damaged(unsigned seed) {
  std::mt19937 random(seed);
  TriangleSoup soup = random_shape(random);
  for (std::size_t i = below(random, 6); i-- > 0;) damage(soup, random);
  MeshSpec spec = testing::sized(uniform(random, 0.12, 0.3));
  constexpr std::array kModes{VolumeMode::All, VolumeMode::Outermost, VolumeMode::Solid};
  spec.volume.mode = kModes[below(random, kModes.size())];
  if (below(random, 3) == 0) spec.layers.push_back(testing::layers_of({"*"}, 2, 0.02));
  try {
    const Outcome outcome = testing::run(std::move(soup), spec);
    testing::expect_sound(outcome);
  } catch (const MeshError& error) {
    EXPECT_EQ(error.failure(), Failure::InvalidInput) << error.what();
    EXPECT_NE(error.diagnostic().reason, Reason::InvariantViolated) << error.what();
  }
}

void expect_fitted(const Outcome& outcome, double volume, double tolerance) {
  testing::expect_sound(outcome);
  EXPECT_LE(outcome.rung, Rung::FeaturesSoftened);
  EXPECT_NEAR(testing::meshed_volume(outcome), volume, tolerance * volume);
}

bool tells(const Outcome& outcome, Reason reason, std::string_view words) {
  return std::any_of(outcome.adjustments.begin(), outcome.adjustments.end(),
                     [&](const Diagnostic& d) { return d.reason == reason && d.message.find(words) != std::string::npos; });
}

// No curve parts shells where they cross.
TEST(CrossingShells, MeshedAsOneFollowBoth) {
  MeshSpec spec = testing::sized(0.08);
  spec.volume.mode = VolumeMode::Solid;
  const TriangleSoup ball = test::shifted(test::scaled(test::sphere(3), 0.4), Vec3(0.5, 0.5, 1));
  const Outcome outcome = testing::run(test::joined(test::cube(3), ball), spec);
  expect_fitted(outcome, 1 + 0.5 * testing::volume_of(ball), 0.02);
  EXPECT_NEAR(testing::patch(outcome, "sphere").area, 0.5 * testing::area_of(ball, "sphere"), 0.1 * testing::area_of(ball, "sphere"));
}

TriangleSoup without(TriangleSoup soup, const std::string& patch) {
  for (std::size_t t = soup.triangles.size(); t-- > 0;)
    if (soup.patch_names[static_cast<std::size_t>(soup.patch[t])] == patch) drop_triangle(soup, t);
  return soup;
}
MeshSpec in_the_well(double size) {
  MeshSpec spec = testing::sized(size);
  spec.volume.mode = VolumeMode::Points;
  spec.volume.points = {Vec3(0.5, 0.5, 1)};
  return spec;
}

// The well's edge is sharp: the cap makes it so.
TEST(OpenShells, GetFlatCaps) {
  const TriangleSoup well = without(test::box(Vec3(0, 0, 0), Vec3(1, 1, 3), 4), "z_max");
  const Outcome open = testing::run(well, in_the_well(0.12));
  expect_fitted(open, 3, 1e-6);
  EXPECT_EQ(open.rung, Rung::Full);
  EXPECT_TRUE(tells(open, Reason::SurfaceNotClosed, "openings of the surface were closed"));
  // A lid that does not reach the walls: the cap is a frame.
  TriangleSoup lid = test::box(Vec3(0.25, 0.25, 2), Vec3(0.75, 0.75, 3), 2);
  for (const char* side : {"x_min", "x_max", "y_min", "y_max", "z_min"}) lid = without(std::move(lid), side);
  const Outcome gap = testing::run(test::joined(well, lid), in_the_well(0.12));
  expect_fitted(gap, 3, 1e-6);
}

TriangleSoup bent_well(double by) {
  TriangleSoup well = without(test::box(Vec3(0, 0, 0), Vec3(1, 1, 3), 4), "z_max");
  for (Vec3& p : well.points)
    if (p.z() > 2.9) p.z() += by * std::cos(2 * std::numbers::pi * (p.x() + p.y()));
  return well;
}

TEST(OpenShells, GetBentCaps) {
  const Outcome outcome = testing::run(bent_well(0.1), in_the_well(0.12));
  expect_fitted(outcome, 3, 0.05);
  EXPECT_TRUE(tells(outcome, Reason::SurfaceNotClosed, "openings of the surface were closed"));
}

// What is too bent for a cap gets a skin where the winding number is a half.
TEST(OpenShells, GetASkinOfTheMeshsOwn) {
  const Outcome outcome = testing::run(bent_well(0.3), in_the_well(0.12));
  testing::expect_sound(outcome);
  EXPECT_NEAR(testing::meshed_volume(outcome), 3, 0.2);
  EXPECT_TRUE(tells(outcome, Reason::SurfaceNotClosed, "closed by a skin of the mesh's own"));
}

class RandomDamage : public ::testing::TestWithParam<unsigned> {};
TEST_P(RandomDamage, EndsWithASoundMeshOrARefusal) { run_damaged(GetParam()); }
INSTANTIATE_TEST_SUITE_P(Dirty, RandomDamage, ::testing::Range(0U, 12U));

}  // namespace
}  // namespace strata
