#include "core/fit/retreat.h"

#include <gtest/gtest.h>

#include <random>

#include "core/fit/fit.h"
#include "tests/support/grids.h"

namespace strata {
namespace {

TEST(Retreat, LeavesAValidFitAlone) {
  const HexMesh start = testing::grid(3, 3, 3);
  HexMesh fitted = start;
  for (Vec3& p : fitted.position) p *= 1.1;
  const Retreat result = retreat(start, fitted);
  EXPECT_EQ(result.moved, 0);
  EXPECT_EQ(result.bad, 0);
  EXPECT_EQ(result.mesh.position, fitted.position);
}

TEST(Retreat, GoesBackOnlyNearWhatIsInverted) {
  const HexMesh start = testing::grid(6, 3, 3);
  HexMesh fitted = start;
  for (Vec3& p : fitted.position) p.z() *= 1.2;
  for (VertexId v : start.position.ids())
    if (start.position[v] == Vec3(0, 1, 3)) fitted.position[v] = Vec3(2.5, 1, 0);
  ASSERT_FALSE(bad_hexes(fitted).empty());
  const Retreat result = retreat(start, fitted);
  EXPECT_EQ(result.bad, 0);
  EXPECT_TRUE(bad_hexes(result.mesh).empty());
  EXPECT_GT(result.moved, 0);
  for (VertexId v : start.position.ids())
    if (start.position[v].x() > 3) {
      EXPECT_EQ(result.mesh.position[v], fitted.position[v]);
    }
}

TEST(Retreat, FromAnythingToAValidMesh) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> wobble(-1.5, 1.5);
  for (int round = 0; round < 20; ++round) {
    const HexMesh start = testing::random_solid(6, random);
    HexMesh fitted = start;
    for (Vec3& p : fitted.position) p += Vec3(wobble(random), wobble(random), wobble(random));
    EXPECT_EQ(retreat(start, fitted).bad, 0);
  }
}

}  // namespace
}  // namespace strata
