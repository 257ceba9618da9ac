#include "core/quality/validity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "core/mesh/hex.h"
#include "core/quality/quality.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"

namespace strata::testing {
namespace {

using ::testing::HasSubstr;

// n^3 cells; those on the boundary belong to a layer, so that they may have several quads.
HexMesh sound(int n) {
  HexMesh mesh = grid(n, n, n);
  for (std::uint16_t& layer : mesh.layer) layer = 1;
  return mesh;
}
HexMesh two_regions() {
  HexMesh mesh = grid_of_regions(4, 2, 2, [](int x, int, int) { return x < 2 ? 0 : 1; });
  for (std::uint16_t& layer : mesh.layer) layer = 1;
  return mesh;
}

TEST(CheckMesh, FindsNothingInSoundMeshes) {
  std::mt19937 random(3);
  for (HexMesh mesh : {sound(1), sound(3), two_regions(), random_solid(5, random)}) {
    for (std::uint16_t& layer : mesh.layer) layer = 1;
    for (HexId h : mesh.hexes.ids()) ASSERT_TRUE(mesh.hexes[h][0].valid());
    const auto found = check_mesh(mesh);
    const bool many_quads = check_quads_per_hex(mesh, 3) != "";
    EXPECT_EQ(found.has_value(), many_quads) << found->message;
  }
}

struct Damage {
  const char* name;
  std::function<void(HexMesh&)> harm;
  const char* message;
};
class CheckMeshFinds : public ::testing::TestWithParam<Damage> {};

TEST_P(CheckMeshFinds, TheDamage) {
  for (HexMesh mesh : {sound(3), two_regions()}) {
    ASSERT_FALSE(check_mesh(mesh).has_value());
    GetParam().harm(mesh);
    const auto found = check_mesh(mesh);
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->reason, Reason::InvariantViolated);
    EXPECT_EQ(found->severity, Severity::Error);
    EXPECT_THAT(found->message, HasSubstr(GetParam().message));
  }
}

const HexId kHex{5};
const QuadId kQuad{7};

INSTANTIATE_TEST_SUITE_P(
    Of, CheckMeshFinds,
    ::testing::Values(
        Damage{"MissingAttachments", [](HexMesh& m) { m.attachment.resize(1); }, "vertex arrays"},
        Damage{"MissingRegions", [](HexMesh& m) { m.region.resize(1); }, "hex arrays"},
        Damage{"MissingLayers", [](HexMesh& m) { m.layer.clear(); }, "hex arrays"},
        Damage{"MissingPatches", [](HexMesh& m) { m.patch.clear(); }, "quad arrays"},
        Damage{"NoHexes", [](HexMesh& m) { m = {}; }, "empty"},
        Damage{"NotANumber", [](HexMesh& m) { m.position[VertexId(4)].y() = std::nan(""); }, "vertex 4 has a coordinate"},
        Damage{"Infinite", [](HexMesh& m) { m.position[VertexId(4)].z() = INFINITY; }, "vertex 4 has a coordinate"},
        Damage{"VertexTooLarge", [](HexMesh& m) { m.hexes[kHex][3] = VertexId(100000); }, "hex 5 has a vertex or a region out of range"},
        Damage{"VertexNegative", [](HexMesh& m) { m.hexes[kHex][3] = VertexId(); }, "hex 5 has a vertex or a region out of range"},
        Damage{"RegionUnknown", [](HexMesh& m) { m.region[kHex] = RegionId(); }, "hex 5 has a vertex or a region out of range"},
        Damage{"QuadVertexTooLarge", [](HexMesh& m) { m.quads[kQuad][0] = VertexId(100000); },
               "quad 7 has a vertex or a patch out of range"},
        Damage{"QuadWithoutPatch", [](HexMesh& m) { m.patch[kQuad] = PatchId(); }, "quad 7 has a vertex or a patch out of range"},
        Damage{"RepeatedVertex", [](HexMesh& m) { m.hexes[kHex][6] = m.hexes[kHex][0]; }, "hex 5 has a vertex twice"},
        Damage{"HexTwice",
               [](HexMesh& m) {
                 m.hexes.push_back(HexVertices(m.hexes[kHex]));
                 m.region.push_back(RegionId(m.region[kHex]));
                 m.layer.push_back(1);
               },
               ""},
        Damage{"HexMissing",
               [](HexMesh& m) {
                 m.hexes.values().pop_back();
                 m.region.values().pop_back();
                 m.layer.values().pop_back();
               },
               ""},
        Damage{"HexInsideOut",
               [](HexMesh& m) {
                 HexVertices& v = m.hexes[kHex];
                 v = {v[4], v[5], v[6], v[7], v[0], v[1], v[2], v[3]};
               },
               ""},
        Damage{"QuadMissing",
               [](HexMesh& m) {
                 m.quads.values().pop_back();
                 m.patch.values().pop_back();
                 m.chart.values().pop_back();
               },
               "face has no quad"},
        Damage{"QuadTwice",
               [](HexMesh& m) { m.quads.push_back(QuadVertices(m.quads[kQuad])), m.patch.push_back({PatchId(0)}), m.chart.push_back({}); },
               "two quads lie on one face"},
        Damage{"QuadInwards", [](HexMesh& m) { std::swap(m.quads[kQuad][1], m.quads[kQuad][3]); }, "points"},
        Damage{"QuadOnNothing",
               [](HexMesh& m) {
                 const HexVertices& v = m.hexes[kHex];
                 m.quads.push_back({v[0], v[1], v[6], v[7]}), m.patch.push_back(PatchId(0)), m.chart.push_back({});
               },
               "a quad lies on no face"},
        Damage{"QuadInside",
               [](HexMesh& m) {  // the first face with two hexes of one region
                 HexMesh skin = m;
                 set_quads(skin);
                 for (HexId h : m.hexes.ids())
                   for (int f = 0; f < 6; ++f) {
                     const auto& c = kHexFaces[static_cast<std::size_t>(f)];
                     Vec3 n = Vec3::Zero();
                     for (auto i : c) n += 0.25 * m.position[m.hexes[h][static_cast<std::size_t>(i)]];
                     if (n != Vec3(1, 0.5, 0.5)) continue;
                     QuadVertices q;
                     for (std::size_t i = 0; i < 4; ++i) q[i] = m.hexes[h][static_cast<std::size_t>(c[i])];
                     m.quads.push_back(q), m.patch.push_back(PatchId(0)), m.chart.push_back({});
                     return;
                   }
               },
               "a quad lies inside a region"},
        Damage{"ManyQuadsInTheVolume", [](HexMesh& m) { m.layer.assign(m.layer.size(), 0); }, " quads"},
        Damage{"InvertedCorner",
               [](HexMesh& m) {
                 const HexVertices v = m.hexes[HexId(0)];
                 m.position[v[0]] = m.position[v[0]] + 1.2 * (m.position[v[6]] - m.position[v[0]]);
               },
               "hex 0 is not positive"},
        Damage{"Flat",
               [](HexMesh& m) {
                 for (Vec3& p : m.position) p.z() = 0;
               },
               "hex 0 is not positive"}),
    [](const auto& at) { return at.param.name; });

TEST(CheckMesh, TellsWhereTheDamageIs) {
  HexMesh mesh = sound(3);
  mesh.position[mesh.hexes[HexId(26)][6]] = Vec3(1.5, 1.5, 1.5);
  const auto found = check_mesh(mesh);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->message, "hex 26 is not positive at each corner and its centre");
  EXPECT_EQ(found->box.min, Vec3(1.5, 1.5, 1.5));
  EXPECT_EQ(found->box.max, Vec3(3, 3, 3));
}

TEST(CheckMesh, RefusesBoundaryEdgesWithFourQuads) {
  // Two cells that touch along an edge only.
  HexMesh mesh = grid(2, 2, 1, [](int x, int y, int) { return x == y; });
  for (HexMesh* m : {&mesh}) m->layer.assign(m->layer.size(), 1);
  const auto found = check_mesh(mesh);
  ASSERT_TRUE(found.has_value());
  EXPECT_THAT(found->message, HasSubstr("quads"));
}

TEST(CheckMesh, AcceptsTheHexesThatVerdictFindsPositive) {
  int accepted = 0, refused = 0;
  std::mt19937 random(19);
  for (int round = 0; round < 200; ++round) {
    std::uniform_real_distribution<double> noise(-0.35, 0.35);
    HexMesh mesh = sound(2);
    for (Vec3& p : mesh.position) p += Vec3(noise(random), noise(random), noise(random));
    double least = 1;
    for (const HexVertices& hex : mesh.hexes) {
      std::array<Vec3, 8> corners;
      for (std::size_t i = 0; i < 8; ++i) corners[i] = mesh.position[hex[i]];
      least = std::min(least, scaled_jacobian(corners));
    }
    const bool found = check_mesh(mesh).has_value();
    EXPECT_EQ(found, !(least > 0)) << "round " << round;
    ++(found ? refused : accepted);
  }
  EXPECT_GT(accepted, 10);
  EXPECT_GT(refused, 10);
}

TEST(CheckMesh, SaysTheSameForAnyNumberOfThreads) {
  std::mt19937 random(7);
  HexMesh mesh = sound(24);
  std::uniform_int_distribution<std::size_t> any(0, mesh.quads.size() - 1);
  for (int i = 0; i < 40; ++i) std::swap(mesh.quads[QuadId(any(random))][1], mesh.quads[QuadId(any(random))][3]);
  std::string first;
  for (const std::size_t threads : {1, 2, 4}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const auto found = check_mesh(mesh);
    ASSERT_TRUE(found.has_value());
    if (first.empty()) first = found->message;
    EXPECT_EQ(found->message, first);
  }
}

TEST(CheckMesh, AgreesWithTheSlowChecksOnRandomDamage) {
  std::mt19937 random(13);
  const HexMesh original = sound(3);
  std::uniform_int_distribution<int> hex(0, 26), corner(0, 7), vertex(0, 63), quad(0, 53);
  for (int round = 0; round < 300; ++round) {
    HexMesh mesh = original;
    switch (round % 3) {
      case 0: mesh.hexes[HexId(hex(random))][static_cast<std::size_t>(corner(random))] = VertexId(vertex(random)); break;
      case 1: mesh.quads[QuadId(quad(random))][static_cast<std::size_t>(corner(random) / 2)] = VertexId(vertex(random)); break;
      default: mesh.position[VertexId(vertex(random))] += Vec3::Constant(0.3 * (corner(random) - 3.5)); break;
    }
    const bool damaged = !check_topology(mesh).empty() || !check_positive(mesh).empty();
    const auto found = check_mesh(mesh);
    EXPECT_EQ(found.has_value(), damaged) << "round " << round << ": " << check_topology(mesh) << check_positive(mesh)
                                          << (found ? found->message : "");
  }
}

}  // namespace
}  // namespace strata::testing
