#include "core/layers/spread.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/grids.h"

namespace strata::testing {
namespace {

struct Pushed {
  HexMesh mesh = grid(3, 3, 8);
  IdMap<VertexId, Role> role;
  IdMap<VertexId, Vec3> move;

  Pushed() : role(mesh.position.size(), Role::Carried), move(mesh.position.size(), Vec3::Zero()) {
    for (VertexId v : mesh.position.ids())
      if (mesh.position[v].z() == 0) role[v] = Role::Driven, move[v] = Vec3(0, 0, 1);
  }
};

TEST(Spread, FadesWithTheDistanceAndEndsAfterItsRings) {
  Pushed p;
  const int rings = 4;
  const Spread spread(p.mesh, hexes_round_vertices(p.mesh), p.role, rings);
  spread.fill(p.move);
  for (VertexId v : p.mesh.position.ids()) {
    const double z = p.mesh.position[v].z();
    EXPECT_NEAR(p.move[v].x(), 0, 1e-12);
    if (z > rings) {
      EXPECT_EQ(p.move[v], Vec3(0, 0, 0));
    }
    if (z > 0 && z <= rings) {
      EXPECT_GT(p.move[v].z(), 0);
      EXPECT_NEAR(p.move[v].z(), 1 - z / (rings + 1), 0.15);   // a flat front: nearly linear
    }
  }
}

TEST(Spread, LeavesWhatIsDrivenOrStill) {
  Pushed p;
  for (VertexId v : p.mesh.position.ids())
    if (p.mesh.position[v].z() == 2) p.role[v] = Role::Still;
  const Spread spread(p.mesh, hexes_round_vertices(p.mesh), p.role, 6);
  spread.fill(p.move);
  for (VertexId v : p.mesh.position.ids()) {
    const double z = p.mesh.position[v].z(), moved = p.move[v].z();
    if (z <= 2) {
      EXPECT_NEAR(moved, 1 - 0.5 * z, z == 1 ? 0.3 : 0);
    }
  }
}

TEST(Spread, DoesNotCrossEdgesThatAreApart) {
  Pushed p;
  Spread::Among among{IdMap<VertexId, std::uint8_t>(p.mesh.position.size(), 1), {}};
  for (VertexId a : p.mesh.position.ids())
    for (VertexId b : p.mesh.position.ids())
      if (p.mesh.position[a].z() == 0 && p.mesh.position[b] == p.mesh.position[a] + Vec3(0, 0, 1)) among.apart.emplace_back(a, b);
  std::sort(among.apart.begin(), among.apart.end());
  const Spread spread(p.mesh, hexes_round_vertices(p.mesh), p.role, 3, among);
  spread.fill(p.move);
  for (VertexId v : p.mesh.position.ids())
    if (p.mesh.position[v].z() > 0) {
      EXPECT_EQ(p.move[v], Vec3(0, 0, 0));
    }
}

// Springs in a row: each gives way in proportion to the square of its length.
TEST(Spread, LetsLargeHexesBearMoreThanSmallOnes) {
  Pushed p;
  const std::vector<double> height{0, 1, 2, 3, 5, 7, 11, 15, 23};
  for (Vec3& at : p.mesh.position) at.z() = height[static_cast<std::size_t>(at.z())];
  for (VertexId v : p.mesh.position.ids())
    if (p.mesh.position[v].z() == height.back()) p.role[v] = Role::Still;
  const Spread spread(p.mesh, hexes_round_vertices(p.mesh), p.role, 20, Burden::BySize);
  spread.fill(p.move);
  const auto given = [&](double z) {
    double sum = 0, all = 0;
    for (std::size_t i = 1; i < height.size(); ++i) {
      const double square = (height[i] - height[i - 1]) * (height[i] - height[i - 1]);
      all += square;
      if (height[i] <= z) sum += square;
    }
    return sum / all;
  };
  for (VertexId v : p.mesh.position.ids()) {
    EXPECT_NEAR(p.move[v].z(), 1 - given(p.mesh.position[v].z()), 1e-3);
    EXPECT_NEAR(p.move[v].x(), 0, 1e-12);
  }
}

}  // namespace
}  // namespace strata::testing
