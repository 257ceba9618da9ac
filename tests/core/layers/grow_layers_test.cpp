#include "core/layers/grow_layers.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <string>
#include <vector>

#include "core/quality/quality.h"
#include "tests/core/layers/layer_scene.h"
#include "tests/support/mesh_checks.h"

namespace strata::testing {
namespace {

double worst(const HexMesh& mesh) {
  double least = 1;
  for (const HexVertices& hex : mesh.hexes) {
    std::array<Vec3, 8> c;
    for (std::size_t i = 0; i < 8; ++i) c[i] = mesh.position[hex[i]];
    least = std::min(least, scaled_jacobian(c));
  }
  return least;
}

void expect_sound(const HexMesh& mesh) {
  EXPECT_EQ(check_topology(mesh), "");
  EXPECT_EQ(check_positive(mesh), "");
  EXPECT_GT(worst(mesh), 0);
}

// Layers thin enough that the cube's cells, a quarter of its side, have room for them.
constexpr double kThin = 0.02;
const std::vector<std::string> kSides{"x_min", "x_max", "y_min", "y_max", "z_min", "z_max"};

GrowResult grow(LayerScene& scene, const std::vector<LayerSpec>& layers) {
  return grow_layers(scene.mesh, layers, scene.ground, scene.context);
}

// Dossier 7.9: N = 4 cells a side, n = 3 layers.
struct CubeCase {
  const char* name;
  std::vector<std::string> patches;
  Ending ending;
  std::size_t hexes;
};
class CubeLayers : public ::testing::TestWithParam<CubeCase> {};

TEST_P(CubeLayers, HaveExactlyTheHexesTheSheetsMake) {
  const auto scene = cube_scene(4);
  const GrowResult grown = grow(*scene, {layers_on(GetParam().patches, 3, kThin * scene->surface.frame.scale, 1.2, GetParam().ending)});
  EXPECT_EQ(grown.mesh.hexes.size(), GetParam().hexes);
  EXPECT_EQ(grown.rung, LayersRung::Full);
  expect_sound(grown.mesh);
  for (const PatchLayers& p : grown.patches) {
    EXPECT_NEAR(p.first_height_mean / p.wished.first_height, 1, 0.02);
    EXPECT_GT(p.thickness_fraction_min, 0.95);
    EXPECT_DOUBLE_EQ(p.coverage, 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Cube, CubeLayers,
                         ::testing::Values(CubeCase{"AllJoined", kSides, Ending::Regular, 352},
                                           CubeCase{"AllCrossing", kSides, Ending::CrossImprint, 1000},
                                           CubeCase{"ThreeCrossingAtACorner", {"x_min", "y_min", "z_min"}, Ending::CrossImprint, 343},
                                           CubeCase{"OneImprinting", {"z_min"}, Ending::Imprint, 112},
                                           CubeCase{"TwoCrossing", {"z_min", "x_min"}, Ending::CrossImprint, 196}),
                         [](const auto& at) { return at.param.name; });

// The paper's Fig. 7.
struct CylinderCase {
  const char* name;
  std::vector<std::string> patches;
  Ending ending;
  std::size_t hexes;   // of an O-grid of 4 x 4 + 16 x 3 columns and 8 slabs
};
class CylinderLayers : public ::testing::TestWithParam<CylinderCase> {};

TEST_P(CylinderLayers, EndAsAsked) {
  const auto scene = cylinder_scene(4, 3, 8);
  const GrowResult grown = grow(*scene, {layers_on(GetParam().patches, 4, 0.02 * scene->surface.frame.scale, 1.2, GetParam().ending)});
  EXPECT_EQ(grown.mesh.hexes.size(), GetParam().hexes);
  for (const Diagnostic& d : scene->context.adjustments()) EXPECT_NE(d.reason, Reason::EndingChanged) << d.message;
  expect_sound(grown.mesh);
  for (const PatchLayers& p : grown.patches) {
    EXPECT_NEAR(p.first_height_mean / p.wished.first_height, 1, 0.02);
    EXPECT_DOUBLE_EQ(p.coverage, 1);
  }
}

// Core 64 x 8 = 512 hexes, 128 quads on the side, 64 on a cap; 16 border edges on either cap.
INSTANTIATE_TEST_SUITE_P(Figure7, CylinderLayers,
                         ::testing::Values(CylinderCase{"SideWedgesAtCaps", {"side"}, Ending::Wedge, 512 + 96 * 4 + 32 * 2},
                                           CylinderCase{"SideImprintsCaps", {"side"}, Ending::Imprint, 512 + 128 * 4},
                                           CylinderCase{"CapsWedgeAtSide", {"cap_*"}, Ending::Wedge, 512 + 96 * 4 + 32 * 2},
                                           CylinderCase{"BothCross", {"side", "cap_*"}, Ending::CrossImprint, 512 + 256 * 4 + 32 * 16},
                                           CylinderCase{"BothRegular", {"side", "cap_*"}, Ending::Regular, 512 + 256 * 4},
                                           CylinderCase{"CapsImprintSide", {"cap_*"}, Ending::Imprint, 512 + 128 * 4}),
                         [](const auto& at) { return at.param.name; });

TEST(Layers, ACrossingHasTheProductOfTheCounts) {
  const auto scene = cube_scene(4);
  const double scale = scene->surface.frame.scale;
  const GrowResult grown = grow(*scene, {layers_on({"z_min"}, 2, kThin * scale, 1.2, Ending::CrossImprint),
                                         layers_on({"x_min"}, 5, 0.5 * kThin * scale, 1.3, Ending::CrossImprint)});
  EXPECT_EQ(grown.mesh.hexes.size(), 64U + 4 * 4 * (2 + 5) + 4 * 2 * 5);
  expect_sound(grown.mesh);
}

TEST(Layers, BlendingLayersLeadUpToTheVolume) {
  const auto scene = cube_scene(4);
  LayerSpec spec = layers_on({"z_min"}, 3, 0.002 * scene->surface.frame.scale, 1.2, Ending::Imprint);
  spec.blending = Blending::Auto;
  const GrowResult grown = grow(*scene, {spec});
  EXPECT_GT(grown.mesh.hexes.size(), 112U);
  EXPECT_NEAR(grown.patches.at(0).first_height_mean / grown.patches.at(0).wished.first_height, 1, 0.02);
  expect_sound(grown.mesh);
}

TEST(Layers, TooThickLayersAreThinnedNotInverted) {
  const auto scene = cube_scene(4);
  const GrowResult grown = grow(*scene, {layers_on({"z_min", "z_max"}, 3, 0.3 * scene->surface.frame.scale, 1.2, Ending::Imprint)});
  EXPECT_EQ(grown.rung, LayersRung::Thinned);
  EXPECT_EQ(grown.mesh.hexes.size(), 64U + 2 * 16 * 3);
  expect_sound(grown.mesh);
}

// As thick as the quads are wide and a little more: strips and edges must push the next columns aside.
class ThickCube : public ::testing::TestWithParam<Ending> {};

TEST_P(ThickCube, KeepsTheThicknessAtTheEdges) {
  const auto scene = cube_scene(8);
  const double cell = scene->surface.frame.scale / 8, first = 1.2 * cell / (1 + 1.2 + 1.44);
  const GrowResult grown = grow(*scene, {layers_on(kSides, 3, first, 1.2, GetParam())});
  EXPECT_EQ(grown.rung, LayersRung::Full);
  expect_sound(grown.mesh);
  EXPECT_GT(worst(grown.mesh), 0.1);
  for (const PatchLayers& p : grown.patches) {
    EXPECT_DOUBLE_EQ(p.coverage, 1);
    EXPECT_GT(p.thickness_fraction_mean, 0.98);
  }
}

INSTANTIATE_TEST_SUITE_P(Edges, ThickCube, ::testing::Values(Ending::Regular, Ending::CrossImprint));

TEST(Layers, GrowBeyondTheMotherLayerWhereThereIsRoom) {
  const auto scene = cube_scene(8);
  const double first = 0.3 * scene->surface.frame.scale / (1 + 1.2 + 1.44 + 1.728 + 2.0736);   // 2.4 cells in all
  const GrowResult grown = grow(*scene, {layers_on({"z_min"}, 5, first, 1.2, Ending::Imprint)});
  expect_sound(grown.mesh);
  EXPECT_GT(grown.patches.at(0).thickness_fraction_min, 0.95);
}

// One hex of the volume is crushed onto the wall: the layers may be thin there, and nowhere else.
TEST(Layers, AreThinOnlyWhereAPlaceIsBad) {
  const auto scene = cube_scene(8);
  const double scale = scene->surface.frame.scale;
  const Vec3 over = scene->surface.frame.to_work(Vec3(0.5, 0.5, 0.125));
  for (Vec3& p : scene->mesh.position)
    if ((p - over).norm() < 1e-9) p.z() -= 0.12 * scale;
  const GrowResult grown = grow(*scene, {layers_on({"z_min"}, 3, 0.02 * scale, 1.2, Ending::Imprint)});
  expect_sound(grown.mesh);
  EXPECT_DOUBLE_EQ(grown.patches.at(0).coverage, 1);
  EXPECT_GT(grown.patches.at(0).thickness_fraction_mean, 0.9);
}

// Any layout of wishes on a box gives a conforming, valid mesh that carries layers wherever they were asked for.
TEST(Layers, OfAnyLayoutOnABoxAreValid) {
  std::mt19937 random(7);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  constexpr std::array<Ending, 4> kEndings{Ending::Auto, Ending::Imprint, Ending::CrossImprint, Ending::Regular};
  for (int trial = 0; trial < 24; ++trial) {
    const auto scene = cube_scene(4);
    std::vector<LayerSpec> layers;
    for (const std::string& side : kSides) {
      if (below(3) == 0) continue;
      const double height = (0.005 + 0.01 * below(6)) * scene->surface.frame.scale;
      layers.push_back(layers_on({side}, 1 + below(4), height, 1.0 + 0.1 * below(4), kEndings[static_cast<std::size_t>(below(4))]));
      layers.back().blending = below(2) == 0 ? Blending::Auto : Blending::None;
    }
    if (layers.empty()) continue;
    SCOPED_TRACE("trial " + std::to_string(trial));
    const GrowResult grown = grow(*scene, layers);
    expect_sound(grown.mesh);
    EXPECT_LT(grown.rung, LayersRung::Dropped);
    for (const PatchLayers& p : grown.patches) EXPECT_DOUBLE_EQ(p.coverage, 1);
  }
}

TEST(Layers, WithoutARequestTheMeshIsUntouched) {
  const auto scene = cube_scene(2);
  const GrowResult grown = grow(*scene, {});
  EXPECT_EQ(grown.mesh.hexes, scene->mesh.hexes);
  EXPECT_EQ(grown.rung, LayersRung::Full);
}

TEST(Layers, AreTheSameEveryTime) {
  const auto scene = cylinder_scene(4, 2, 4);
  const LayerSpec spec = layers_on({"*"}, 3, 0.02 * scene->surface.frame.scale, 1.2, Ending::CrossImprint);
  const GrowResult a = grow(*scene, {spec}), b = grow(*scene, {spec});
  EXPECT_EQ(a.mesh.position, b.mesh.position);
  EXPECT_EQ(a.mesh.hexes, b.mesh.hexes);
}

}  // namespace
}  // namespace strata::testing
