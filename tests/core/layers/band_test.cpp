#include "core/layers/band.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"

namespace strata::testing {
namespace {

IdMap<VertexId, std::uint8_t> on_floor(const HexMesh& mesh) {
  IdMap<VertexId, std::uint8_t> floor(mesh.position.size(), 0);
  for (VertexId v : floor.ids()) floor[v] = mesh.position[v].z() == 0;
  return floor;
}

TEST(Band, HoldsTheRingsNearTheWallAndNothingElse) {
  const HexMesh mesh = grid(4, 4, 6);
  const Band band = cut_band(mesh, on_floor(mesh), 2);
  EXPECT_EQ(band.mesh.hexes.size(), 4U * 4 * 2);
  EXPECT_EQ(band.rest.hexes.size(), 4U * 4 * 4);
  for (VertexId v : band.mesh.position.ids()) EXPECT_EQ(band.mesh.attachment[v].hold == Hold::Fixed, band.mesh.position[v].z() == 2);
}

TEST(Band, JoinsAgainToTheSameMesh) {
  const HexMesh mesh = grid(3, 3, 5);
  IdMap<VertexId, VertexId> in_whole;
  const HexMesh joined = join_band(cut_band(mesh, on_floor(mesh), 2), in_whole);
  EXPECT_EQ(joined.position, mesh.position);
  EXPECT_EQ(joined.attachment, mesh.attachment);
  EXPECT_EQ(joined.hexes.size(), mesh.hexes.size());
  EXPECT_EQ(joined.quads.size(), mesh.quads.size());
  EXPECT_EQ(check_topology(joined), "");
}

TEST(Band, KeepsWhatGrewInIt) {
  const HexMesh mesh = grid(2, 2, 4);
  Band band = cut_band(mesh, on_floor(mesh), 1);
  const VertexId fresh = band.mesh.position.push_back(Vec3(9, 9, 9));
  band.mesh.attachment.push_back({});
  IdMap<VertexId, VertexId> in_whole;
  const HexMesh joined = join_band(std::move(band), in_whole);
  EXPECT_EQ(joined.position[in_whole[fresh]], Vec3(9, 9, 9));
  EXPECT_EQ(in_whole[fresh].index(), mesh.position.size());
}

}  // namespace
}  // namespace strata::testing
