#include "core/quality/contacts.h"

#include <gtest/gtest.h>

#include <random>

#include "core/base/triangle_geometry.h"
#include "tests/support/grids.h"

namespace strata {
namespace {

// The vertex of the mesh at p.
VertexId vertex_at(const HexMesh& mesh, const Vec3& p) {
  for (VertexId v : mesh.position.ids())
    if ((mesh.position[v] - p).norm() < 1e-9) return v;
  ADD_FAILURE() << "no vertex there";
  return {};
}

TEST(Contacts, AGridHasNone) {
  EXPECT_TRUE(find_contacts(testing::grid(5, 4, 3)).empty());
  EXPECT_TRUE(find_contacts(testing::grid_of_regions(4, 4, 4, [](int x, int, int) { return x < 2 ? 0 : 1; })).empty());
}

// A plate with a slot one cell wide: one side of the slot is pushed across to the other.
TEST(Contacts, FindsAVertexOnAForeignQuadAndNoOther) {
  HexMesh mesh = testing::grid(3, 3, 4, [](int x, int, int z) { return x != 1 || z == 0; });
  const VertexId v = vertex_at(mesh, Vec3(1, 1, 3));
  mesh.position[v] = Vec3(2, 1.4, 3.3);
  const std::vector<Contact> contacts = find_contacts(mesh);
  ASSERT_EQ(contacts.size(), 1U);
  EXPECT_EQ(contacts[0].vertex, v);
  for (VertexId corner : mesh.quads[contacts[0].quad]) EXPECT_DOUBLE_EQ(mesh.position[corner].x(), 2);
  mesh.position[v].x() = 2 - 1e-5;
  EXPECT_TRUE(find_contacts(mesh).empty());
  mesh.position[v].x() = 2 + 1e-7;
  EXPECT_EQ(find_contacts(mesh).size(), 1U);
}

TEST(Contacts, AVertexOnAVertexTouchesAllItsQuadsAndTheyItsOwn) {
  HexMesh mesh = testing::grid(3, 3, 4, [](int x, int, int z) { return x != 1 || z == 0; });
  const VertexId v = vertex_at(mesh, Vec3(1, 1, 3)), w = vertex_at(mesh, Vec3(2, 1, 3));
  mesh.position[v] = mesh.position[w];
  const std::vector<Contact> contacts = find_contacts(mesh);
  EXPECT_EQ(contacts.size(), 8U);
  for (const Contact& c : contacts) EXPECT_TRUE(c.vertex == v || c.vertex == w);
}

// The slow and obvious way on bent skins of quads of very different sizes.
TEST(Contacts, AgreesWithTryingAllPairs) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> wobble(-0.6, 0.6);
  std::size_t in_all = 0;
  for (int round = 0; round < 20; ++round) {
    HexMesh mesh = testing::random_solid(5, random);
    for (Vec3& p : mesh.position) {
      p += Vec3(wobble(random), wobble(random), wobble(random));
      p = p.array().exp() - 2;
    }
    const double share = 0.05;
    std::vector<Contact> expected;
    std::vector<std::uint8_t> on_skin(mesh.position.size(), 0);
    for (const QuadVertices& q : mesh.quads)
      for (VertexId v : q) on_skin[v.index()] = 1;
    for (VertexId v : mesh.position.ids())
      for (QuadId q : mesh.quads.ids()) {
        const QuadVertices& c = mesh.quads[q];
        if (on_skin[v.index()] == 0 || std::find(c.begin(), c.end(), v) != c.end()) continue;
        Vec3 centre = Vec3::Zero();
        double shortest = 1e300, distance = 1e300;
        for (std::size_t k = 0; k < 4; ++k) {
          centre += 0.25 * mesh.position[c[k]];
          shortest = std::min(shortest, (mesh.position[c[k]] - mesh.position[c[(k + 1) & 3]]).norm());
        }
        for (std::size_t k = 0; k < 4; ++k) {
          const Vec3 near = closest_on_triangle(mesh.position[v], mesh.position[c[k]], mesh.position[c[(k + 1) & 3]], centre);
          distance = std::min(distance, (near - mesh.position[v]).norm());
        }
        if (distance <= share * shortest) expected.push_back({v, q});
      }
    EXPECT_EQ(find_contacts(mesh, share), expected);
    in_all += expected.size();
  }
  EXPECT_GT(in_all, 50U);
}

}  // namespace
}  // namespace strata
