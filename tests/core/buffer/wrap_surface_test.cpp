#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/buffer/thicken.h"
#include "core/buffer/wrap.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"

namespace strata {
namespace {

using testing::check_topology;
using testing::grid;

TEST(WrapSurface, LeavesEveryHexWithAtMostOneQuadAndEveryHexPositive) {
  Context context;
  const HexMesh before = grid(4, 3, 5);
  const HexMesh mesh = wrap_surface(before, context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::check_quads_per_hex(mesh, 1), "");
  EXPECT_EQ(testing::check_positive(mesh), "");
  EXPECT_EQ(mesh.hexes.size(), before.hexes.size() + before.quads.size());
  EXPECT_GT(testing::hex_volume(mesh), testing::hex_volume(before));
}

TEST(WrapSurface, KeepsQuadsAndTheirLabels) {
  Context context;
  const HexMesh before = grid(3, 3, 3);
  const HexMesh mesh = wrap_surface(before, context);
  EXPECT_EQ(mesh.quads, before.quads);
  EXPECT_EQ(mesh.chart, before.chart);
}

TEST(WrapSurface, StaircasesWithReentrantCornersBecomePositive) {
  Context context;
  const HexMesh mesh = wrap_surface(grid(6, 6, 6, [](int x, int y, int z) { return x + y + z < 11 && x + y + z > 3; }), context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::check_quads_per_hex(mesh, 1), "");
  EXPECT_LT(testing::count_not_positive_hexes(mesh), 20);
}

TEST(WrapSurface, RandomSolidsStayConforming) {
  Context context;
  std::mt19937 random(3);
  for (int round = 0; round < 20; ++round) {
    const HexMesh mesh = wrap_surface(testing::random_solid(4, random), context);
    ASSERT_EQ(check_topology(mesh), "");
    ASSERT_EQ(testing::check_quads_per_hex(mesh, 1), "");
  }
}

TEST(WrapSurface, LinesInterfacesOnBothSides) {
  Context context;
  const HexMesh before = testing::grid_of_regions(6, 4, 4, [](int x, int, int) { return x / 2; });
  const HexMesh mesh = wrap_surface(before, context);
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(testing::check_quads_per_hex(mesh, 1), "");
  EXPECT_EQ(testing::check_positive(mesh), "");
  const std::size_t interfaces = 2 * 16;
  EXPECT_EQ(mesh.hexes.size(), before.hexes.size() + before.quads.size() + interfaces);
}

TEST(WrapSurface, LinesANestedRegionAndRegionsMeetingAtAnEdge) {
  Context context;
  for (int variant : {0, 1}) {
    const HexMesh mesh = wrap_surface(testing::grid_of_regions(6, 6, 6,
                                                               [&](int x, int y, int z) {
                                                                 const auto mid = [](int i) { return i >= 2 && i < 4; };
                                                                 if (variant == 0) return mid(x) && mid(y) && mid(z) ? 1 : 0;
                                                                 return (x < 3 ? 0 : 1) + (y < 3 ? 0 : 2);
                                                               }),
                                      context);
    EXPECT_EQ(check_topology(mesh), "");
    EXPECT_EQ(testing::check_quads_per_hex(mesh, 1), "");
    EXPECT_EQ(testing::check_positive(mesh), "");
  }
}

TEST(WrapSurface, RefusesAPinchedSkin) {
  Context context;
  EXPECT_THROW(wrap_surface(grid(2, 2, 1, [](int x, int y, int) { return x == y; }), context), MeshError);
}

TEST(VisibleDirection, SeesEveryNormalAsWellAsCanBe) {
  const Vec3 d = visible_direction({Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ(), Vec3::UnitZ(), Vec3::UnitZ()});
  EXPECT_NEAR(d.norm(), 1, 1e-12);
  EXPECT_GT(d.minCoeff(), 0.95 / std::sqrt(3.0));
}

}  // namespace
}  // namespace strata
