#include "core/mesh/adjacency.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/base/diagnostic.h"
#include "tests/support/grids.h"

namespace strata::testing {
namespace {

Vec3 unit_corner(int i) { return Vec3(i == 1 || i == 2 || i == 5 || i == 6, i == 2 || i == 3 || i == 6 || i == 7, i >= 4); }

TEST(HexTables, FacesLookOutwardsAndOppositeFacesShareNothing) {
  for (int f = 0; f < 6; ++f) {
    const auto& c = kHexFaces[static_cast<std::size_t>(f)];
    const Vec3 normal = (unit_corner(c[1]) - unit_corner(c[0])).cross(unit_corner(c[3]) - unit_corner(c[0]));
    Vec3 centre = Vec3::Zero();
    for (const std::int8_t i : c) centre += 0.25 * unit_corner(i);
    EXPECT_EQ(normal, 2 * (centre - Vec3::Constant(0.5))) << "face " << f;
    const auto& other = kHexFaces[static_cast<std::size_t>(opposite_face(f))];
    for (const std::int8_t i : c) EXPECT_EQ(std::count(other.begin(), other.end(), i), 0);
  }
}

TEST(HexTables, CornersAreRightHandedAndJoinedByEdges) {
  for (int c = 0; c < 8; ++c) {
    Mat3 axes;
    for (int k = 0; k < 3; ++k) {
      const int n = kHexCorners[static_cast<std::size_t>(c)][static_cast<std::size_t>(k)];
      axes.col(k) = unit_corner(n) - unit_corner(c);
      const bool edge = std::any_of(kHexEdges.begin(), kHexEdges.end(),
                                    [&](const auto& e) { return (e[0] == c && e[1] == n) || (e[0] == n && e[1] == c); });
      EXPECT_TRUE(edge) << c << " " << n;
    }
    EXPECT_DOUBLE_EQ(axes.determinant(), 1) << "corner " << c;
  }
}

TEST(FaceNeighbours, AreMutualAndShareTheirVertices) {
  std::mt19937 random(5);
  const HexMesh mesh = random_solid(5, random);
  const FaceNeighbours neighbours = face_neighbours(mesh);
  std::size_t boundary = 0;
  for (HexId h : mesh.hexes.ids())
    for (int f = 0; f < 6; ++f) {
      const FaceNeighbour& n = neighbours[h][static_cast<std::size_t>(f)];
      if (!n.hex.valid()) {
        ++boundary;
        continue;
      }
      EXPECT_EQ(neighbours[n.hex][static_cast<std::size_t>(n.face)].hex, h);
      EXPECT_EQ(neighbours[n.hex][static_cast<std::size_t>(n.face)].face, f);
      QuadVertices a = face_vertices(mesh.hexes[h], f), b = face_vertices(mesh.hexes[n.hex], n.face);
      std::sort(a.begin(), a.end());
      std::sort(b.begin(), b.end());
      EXPECT_EQ(a, b);
    }
  EXPECT_EQ(boundary, mesh.quads.size());
}

TEST(FaceNeighbours, RefuseAFaceOfThreeHexes) {
  HexMesh mesh = grid(2, 1, 1);
  mesh.hexes.push_back(HexVertices(mesh.hexes[HexId(0)]));
  EXPECT_THROW(face_neighbours(mesh), MeshError);
}

TEST(VertexStars, HoldEveryElementOnceInOrder) {
  const HexMesh mesh = grid(3, 3, 3);
  const auto hexes = hexes_round_vertices(mesh);
  const auto quads = quads_round_vertices(mesh);
  EXPECT_EQ(hexes.elements.size(), 8 * mesh.hexes.size());
  EXPECT_EQ(quads.elements.size(), 4 * mesh.quads.size());
  for (VertexId v : mesh.position.ids()) {
    const auto star = hexes.of(v);
    EXPECT_TRUE(std::is_sorted(star.begin(), star.end()));
    EXPECT_EQ(std::adjacent_find(star.begin(), star.end()), star.end());
    for (HexId h : star) EXPECT_EQ(std::count(mesh.hexes[h].begin(), mesh.hexes[h].end(), v), 1);
    for (QuadId q : quads.of(v)) EXPECT_EQ(std::count(mesh.quads[q].begin(), mesh.quads[q].end(), v), 1);
  }
}

TEST(QuadSides, HaveTheHexBehindAndOnlyInterfacesOneInFront) {
  const HexMesh mesh = grid_of_regions(4, 2, 2, [](int x, int, int) { return x < 2 ? 1 : 0; });
  std::int64_t interfaces = 0;
  const IdMap<QuadId, QuadSides> all = quad_sides(mesh);
  for (QuadId q : mesh.quads.ids()) {
    const QuadSides& sides = all[q];
    ASSERT_TRUE(sides.back.valid());
    if (!sides.front.valid()) continue;
    ++interfaces;
    EXPECT_EQ(mesh.region[sides.back], RegionId(0)) << "out of the smaller region";
    EXPECT_EQ(mesh.region[sides.front], RegionId(1));
  }
  EXPECT_EQ(interfaces, 4);
}

}  // namespace
}  // namespace strata::testing
