#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/sizing/size_field.h"

namespace strata {
namespace {

SizeGrid random_grid(std::mt19937& random) {
  std::uniform_real_distribution<double> size(0.1, 1);
  SizeGrid grid{Vec3(-1, 0, 2), Vec3(1, 3, 3), {4, 3, 5}, {}};
  for (int i = 0; i < 4 * 3 * 5; ++i) grid.sizes.push_back(size(random));
  return grid;
}

TEST(SizeGrid, AsksForNothingOutside) {
  std::mt19937 random(1);
  const SizeGrid grid = random_grid(random);
  EXPECT_TRUE(std::isinf(grid.smallest_in(Vec3(1.1, 0, 2), 0.5)));
  EXPECT_TRUE(std::isinf(grid.smallest_in(Vec3(0, 0, 0), 1.9)));
  EXPECT_TRUE(std::isinf(SizeGrid().smallest_in(Vec3(0, 0, 0), 1)));
}

TEST(SizeGrid, GivesTheNodesTheirSizes) {
  std::mt19937 random(2);
  const SizeGrid grid = random_grid(random);
  for (int z = 0; z < 5; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 4; ++x) {
        const Vec3 node(-1 + 2.0 * x / 3, 3.0 * y / 2, 2 + z / 4.0);
        EXPECT_NEAR(grid.smallest_in(node, 0), grid.sizes[static_cast<std::size_t>(x + 4 * (y + 3 * z))], 1e-12);
      }
}

// Points inside a cube never ask for less than the cube does, and the least of many comes near.
TEST(SizeGrid, FindsTheLeastOverACube) {
  std::mt19937 random(3);
  const SizeGrid grid = random_grid(random);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int round = 0; round < 50; ++round) {
    const double edge = 0.9 * unit(random);
    const Vec3 low = Vec3(-1, 0, 2) + Vec3(unit(random) * (2 - edge), unit(random) * (3 - edge), unit(random) * (1 - edge));
    const double least = grid.smallest_in(low, edge);
    double sampled = 1;
    for (int i = 0; i < 4000; ++i)
      sampled = std::min(sampled, grid.smallest_in(low + edge * Vec3(unit(random), unit(random), unit(random)), 0));
    EXPECT_LE(least, sampled + 1e-12);
    EXPECT_NEAR(least, sampled, 0.15);
  }
}

}  // namespace
}  // namespace strata
