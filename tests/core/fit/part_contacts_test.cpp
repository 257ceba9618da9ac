#include "core/fit/part_contacts.h"

#include <gtest/gtest.h>

#include "core/fit/fit.h"
#include "core/quality/contacts.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"

namespace strata {
namespace {

// Two plates on a common foot, a cell apart.
HexMesh fork() {
  return testing::grid(3, 4, 4, [](int x, int, int z) { return x != 1 || z == 0; });
}
VertexId vertex_at(const HexMesh& mesh, const Vec3& p) {
  for (VertexId v : mesh.position.ids())
    if ((mesh.position[v] - p).norm() < 1e-9) return v;
  ADD_FAILURE() << "no vertex there";
  return {};
}

TEST(PartContacts, LeavesACleanSkinAlone) {
  const HexMesh mesh = fork();
  const PartedContacts parted = part_contacts(mesh);
  EXPECT_EQ(parted.moved, 0);
  EXPECT_EQ(parted.left, 0);
  EXPECT_EQ(parted.mesh.position, mesh.position);
}

TEST(PartContacts, DrawsBothSidesApartAndNothingElse) {
  HexMesh mesh = fork();
  for (const double y : {1.0, 2.0}) {
    const VertexId v = vertex_at(mesh, Vec3(1, y, 3)), w = vertex_at(mesh, Vec3(2, y, 3));
    mesh.position[v] = mesh.position[w] = Vec3(1.5, y, 3);
  }
  ASSERT_FALSE(find_contacts(mesh).empty());
  const PartedContacts parted = part_contacts(mesh);
  EXPECT_EQ(parted.left, 0);
  EXPECT_TRUE(find_contacts(parted.mesh).empty());
  EXPECT_TRUE(bad_hexes(parted.mesh).empty());
  EXPECT_EQ(testing::check_topology(parted.mesh), "");
  EXPECT_GT(parted.moved, 3);
  for (VertexId v : mesh.position.ids()) {
    EXPECT_LT((parted.mesh.position[v] - mesh.position[v]).norm(), 0.1);
    if (std::abs(mesh.position[v].x() - 1.5) > 0.6) {
      EXPECT_EQ(parted.mesh.position[v], mesh.position[v]);
    }
  }
}

}  // namespace
}  // namespace strata
