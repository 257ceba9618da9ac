#include "core/mesh/part.h"

#include <gtest/gtest.h>

#include <set>

#include "core/mesh/adjacency.h"
#include "tests/support/grids.h"

namespace strata {
namespace {

VertexId vertex_at(const HexMesh& mesh, const Vec3& p) {
  for (VertexId v : mesh.position.ids())
    if ((mesh.position[v] - p).norm() < 1e-12) return v;
  return {};
}

TEST(MeshPart, HoldsTheRingsRoundTheMarkAndFixesItsCut) {
  const HexMesh whole = testing::grid(6, 6, 6);
  IdMap<VertexId, std::uint8_t> marked(whole.position.size(), 0);
  const VertexId corner = vertex_at(whole, Vec3(0, 0, 0));
  ASSERT_TRUE(corner.valid());
  marked[corner] = 1;
  const MeshPart part = cut_part(whole, marked, 2);
  EXPECT_EQ(part.mesh.hexes.size(), 8U);
  EXPECT_EQ(part.mesh.position.size(), 27U);
  for (VertexId v : part.mesh.position.ids()) {
    const Vec3& p = part.mesh.position[v];
    EXPECT_EQ(p, whole.position[part.whole[v]]);
    const bool on_cut = p.maxCoeff() > 1.5;
    EXPECT_EQ(part.mesh.attachment[v].hold == Hold::Fixed, on_cut);
  }
  for (QuadId q : part.mesh.quads.ids())
    for (VertexId v : part.mesh.quads[q]) EXPECT_LT(v.index(), part.mesh.position.size());
}

TEST(MeshPart, PutsBackWhatMayMoveAndNothingElse) {
  HexMesh whole = testing::grid(5, 5, 5);
  IdMap<VertexId, std::uint8_t> marked(whole.position.size(), 0);
  marked[vertex_at(whole, Vec3(2, 2, 2))] = 1;
  MeshPart part = cut_part(whole, marked, 1);
  for (Vec3& p : part.mesh.position) p += Vec3(0.1, 0, 0);
  const HexMesh before = whole;
  put_back(part, whole);
  std::set<std::int32_t> moved;
  for (VertexId v : whole.position.ids())
    if (whole.position[v] != before.position[v]) moved.insert(v.value);
  EXPECT_EQ(moved, std::set<std::int32_t>{vertex_at(before, Vec3(2, 2, 2)).value});
}

}  // namespace
}  // namespace strata
