#include "core/layers/corner_fan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/grids.h"

namespace strata::testing {
namespace {

// The vertex held by a corner, and the facets round it.
CornerFan only_fan(HexMesh mesh, const Vec3& at) {
  for (VertexId v : mesh.position.ids())
    if ((mesh.position[v] - at).norm() < 1e-12) mesh.attachment[v] = {Hold::Corner, 0};
  const std::vector<CornerFan> fans = corner_fans(mesh, JoinedFacets(mesh));
  EXPECT_EQ(fans.size(), 1U);
  return fans.empty() ? CornerFan{} : fans.front();
}

// Four octants meet: three convex and three concave edges alternate.
CornerFan saddle() {
  return only_fan(grid(2, 2, 2, [](int x, int y, int z) { return x + y + z >= 2; }), {1, 1, 1});
}

// Groups of `run` facets each, counted from the facet `first` on.
std::vector<std::int32_t> groups_from(const CornerFan& fan, std::size_t first, std::size_t run) {
  std::vector<std::int32_t> group(fan.facet.size());
  for (std::size_t i = 0; i < group.size(); ++i) group[(first + i) % group.size()] = static_cast<std::int32_t>(i / run);
  return group;
}

// The facet behind a convex edge.
std::size_t first_convex(const CornerFan& fan) {
  for (std::size_t i = 0; i < fan.facet.size(); ++i) {
    const std::size_t next = (i + 1) % fan.facet.size();
    if (fan.normal[i].cross(fan.normal[next]).dot(fan.spoke[i]) > 0) return next;
  }
  return 0;
}

TEST(CornerFan, OfABoxHasItsThreeFacesInOrder) {
  const CornerFan fan = only_fan(grid(2, 2, 2), {0, 0, 0});
  ASSERT_EQ(fan.facet.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_TRUE(fan.crease[i]);
    EXPECT_NEAR(fan.normal[i].cross(fan.normal[(i + 1) % 3]).dot(fan.normal[(i + 2) % 3]), 1, 1e-12);
    EXPECT_NEAR(fan.normal[i].dot(fan.spoke[i]), 0, 1e-12);
  }
}

TEST(CornerQuality, OfABoxIsBestWhereAllThreeCross) {
  const CornerFan fan = only_fan(grid(2, 2, 2), {0, 0, 0});
  EXPECT_NEAR(corner_quality(fan, {0, 1, 2}), 1, 1e-12);
  EXPECT_NEAR(corner_quality(fan, {0, 0, 1}), std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(corner_quality(fan, {0, 0, 0}), std::sqrt(1.0 / 3), 1e-2);
  EXPECT_TRUE(better_joined(fan, {0, 1, 2}).empty());
}

TEST(CornerQuality, IsNegativeWhereEdgesAlternateAndAllAreBestJoined) {
  const CornerFan fan = saddle();
  ASSERT_EQ(fan.facet.size(), 6U);
  const std::vector<std::int32_t> crossing = groups_from(fan, first_convex(fan), 2);
  EXPECT_NEAR(corner_quality(fan, crossing), -1, 1e-12);
  EXPECT_NEAR(corner_quality(fan, {0, 0, 0, 0, 0, 0}), std::sqrt(1.0 / 3), 1e-2);
  EXPECT_EQ(better_joined(fan, crossing).size(), 3U);
}

// The columns of the larger group slide on the smaller one along its crease, which goes on straight where the two meet.
TEST(CornerQuality, IsNothingWhereAColumnGoesOnAlongAnEdgeOfTheCrossing) {
  const CornerFan fan = saddle();
  std::vector<std::int32_t> group = groups_from(fan, first_convex(fan), 2);
  std::replace(group.begin(), group.end(), 2, 1);
  EXPECT_NEAR(corner_quality(fan, group), 0, 1e-12);
  EXPECT_EQ(better_joined(fan, group), (std::vector<std::int32_t>{0, 1}));
}

}  // namespace
}  // namespace strata::testing
