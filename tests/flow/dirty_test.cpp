// Surfaces with random damage: a sound mesh or a refusal that names the defect, nothing else.
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

class RandomDamage : public ::testing::TestWithParam<unsigned> {};
TEST_P(RandomDamage, EndsWithASoundMeshOrARefusal) { run_damaged(GetParam()); }
INSTANTIATE_TEST_SUITE_P(Dirty, RandomDamage, ::testing::Range(0U, 12U));

}  // namespace
}  // namespace strata
