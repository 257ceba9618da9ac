#include "core/layers/heal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/quality/quality.h"
#include "tests/core/layers/layer_scene.h"

namespace strata::testing {
namespace {

TEST(Heal, LeavesAGoodMeshAlone) {
  const auto scene = cube_scene(4);
  const HexMesh healed = heal(scene->mesh, {}, Soundness::ToBeCut, scene->ground, scene->context);
  EXPECT_EQ(healed.position, scene->mesh.position);
}

TEST(Heal, MakesRoomWhereFewHexesAreInverted) {
  std::mt19937 random(11);
  for (int round = 0; round < 10; ++round) {
    const auto scene = cube_scene(7);
    HexMesh mesh = scene->mesh;
    std::vector<VertexId> inside;
    for (VertexId v : mesh.position.ids())
      if (mesh.attachment[v].hold == Hold::Free) inside.push_back(v);
    const VertexId thrown = inside[random() % inside.size()];
    const VertexStars<HexId> star = hexes_round_vertices(mesh);
    const HexVertices& hex = mesh.hexes[star.of(thrown)[0]];
    Vec3 centre = Vec3::Zero();
    for (VertexId v : hex) centre += mesh.position[v] / 8;
    mesh.position[thrown] += 2.5 * (centre - mesh.position[thrown]);
    ASSERT_FALSE(not_positive(mesh).empty());
    const HexMesh healed = heal(mesh, {}, Soundness::Positive, scene->ground, scene->context);
    EXPECT_TRUE(not_positive(healed).empty());
    EXPECT_EQ(healed.attachment, mesh.attachment);
    for (VertexId v : mesh.position.ids())
      if (mesh.attachment[v].hold == Hold::Corner) {
        EXPECT_EQ(healed.position[v], mesh.position[v]);
      }
  }
}

TEST(Heal, KeepsWhatMustStandStill) {
  const auto scene = cube_scene(6);
  HexMesh mesh = scene->mesh;
  std::vector<VertexId> still;
  for (VertexId v : mesh.position.ids())
    if (mesh.attachment[v].hold != Hold::Free) still.push_back(v);
  const VertexId thrown = [&] {
    for (VertexId v : mesh.position.ids())
      if (mesh.attachment[v].hold == Hold::Free) return v;
    return VertexId();
  }();
  mesh.position[thrown] = mesh.position[mesh.hexes[hexes_round_vertices(mesh).of(thrown)[0]][0]];
  ASSERT_FALSE(not_positive(mesh).empty());
  const HexMesh healed = heal(mesh, still, Soundness::Positive, scene->ground, scene->context);
  EXPECT_TRUE(not_positive(healed).empty());
  for (VertexId v : still) EXPECT_EQ(healed.position[v], mesh.position[v]);
}

TEST(PolishPoorest, RaisesFewPoorHexesButMovesNothingThatStandsStill) {
  const auto scene = cube_scene(7);
  HexMesh mesh = scene->mesh;
  const VertexId drawn = [&] {
    for (VertexId v : mesh.position.ids())
      if (mesh.attachment[v].hold == Hold::Free) return v;
    return VertexId();
  }();
  const HexVertices hex = mesh.hexes[hexes_round_vertices(mesh).of(drawn)[0]];
  Vec3 centre = Vec3::Zero();
  for (VertexId v : hex) centre += mesh.position[v] / 8;
  double share = 0;
  const auto worst = [](const HexMesh& m) {
    double least = 1;
    for (HexId h : m.hexes.ids()) least = std::min(least, corner_scaled_jacobian(corners_of(m, h)));
    return least;
  };
  // As far as leaves hexes positive, but poor.
  const Vec3 from = mesh.position[drawn];
  while (worst(mesh) > 0.08) mesh.position[drawn] = from + (share += 0.02) * (centre - from);
  ASSERT_GT(worst(mesh), 0);
  const HexMesh polished = polish_poorest(mesh, 0.1, Losses::ToBeHealed, {}, scene->ground, scene->context);
  EXPECT_GE(worst(polished), 0.1);
  const HexMesh careful = polish_poorest(mesh, 0.1, Losses::TakenBack, {}, scene->ground, scene->context);
  EXPECT_GT(worst(careful), worst(mesh));
  for (HexId h : mesh.hexes.ids()) EXPECT_GE(scaled_jacobian(corners_of(careful, h)), std::min(0.1, scaled_jacobian(corners_of(mesh, h))));
  std::vector<VertexId> all;
  for (VertexId v : mesh.position.ids()) all.push_back(v);
  const HexMesh held = polish_poorest(mesh, 0.1, Losses::ToBeHealed, all, scene->ground, scene->context);
  EXPECT_EQ(held.position, mesh.position);
}

TEST(Heal, OpensColumnsWithoutLength) {
  const auto scene = cube_scene(5);
  HexMesh mesh = scene->mesh;
  // A vertex inside comes so near to its neighbour that hexes are positive still, but whoever reads the mesh takes the two for one.
  const VertexId v = [&] {
    for (VertexId u : mesh.position.ids())
      if (mesh.attachment[u].hold == Hold::Free) return u;
    return VertexId();
  }();
  VertexId beside;
  for (VertexId u : mesh.position.ids())
    if (mesh.attachment[u].hold == Hold::Free && u != v &&
        (!beside.valid() || (mesh.position[u] - mesh.position[v]).norm() < (mesh.position[beside] - mesh.position[v]).norm()))
      beside = u;
  mesh.position[v] = mesh.position[beside] + 1e-8 * (mesh.position[v] - mesh.position[beside]);
  ASSERT_TRUE(not_positive(mesh).empty());
  const HexMesh healed = heal(mesh, {}, Soundness::ToBeCut, scene->ground, scene->context);
  EXPECT_TRUE(not_positive(healed).empty());
  EXPECT_GT((healed.position[v] - healed.position[beside]).norm(), 1e-5 * (mesh.position[VertexId(1)] - mesh.position[VertexId(0)]).norm());
}

}  // namespace
}  // namespace strata::testing
