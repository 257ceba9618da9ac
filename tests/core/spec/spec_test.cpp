#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>

#include "core/spec/mesh_spec.h"

namespace strata {
namespace {

const std::vector<std::string> kNames = {"inlet", "outlet", "wing_left", "wing_right"};

LayerSpec layer(std::vector<std::string> patches = {"inlet"}) {
  LayerSpec l;
  l.patches = std::move(patches);
  l.count = 3;
  l.first_height = 0.1;
  l.growth = 1.2;
  return l;
}
std::string first_message(const MeshSpec& spec) {
  const auto found = check(spec, kNames);
  return found.empty() ? "" : found.front().message;
}

TEST(Matches, StarsAndQuestionMarks) {
  EXPECT_TRUE(matches("*", ""));
  EXPECT_TRUE(matches("wing*", "wing_left"));
  EXPECT_TRUE(matches("*_l?ft", "wing_left"));
  EXPECT_TRUE(matches("a*b*c", "aXbbYc"));
  EXPECT_FALSE(matches("wing", "wing_left"));
  EXPECT_FALSE(matches("?", ""));
  EXPECT_FALSE(matches("a*b", "aXc"));
  EXPECT_FALSE(matches(std::string(200, '*') + "b", std::string(5000, 'a')));
}

TEST(Resolve, AnySufficientSetGivesTheSameLayers) {
  const int n = 6;
  const double a = 0.01, r = 1.3, b = a * std::pow(r, n - 1), total = a * (std::pow(r, n) - 1) / (r - 1);
  for (int mask = 0; mask < 32; ++mask) {
    LayerSpec l;
    if (mask & 1) l.count = n;
    if (mask & 2) l.first_height = a;
    if (mask & 4) l.last_height = b;
    if (mask & 8) l.total_thickness = total;
    if (mask & 16) l.growth = r;
    const bool heights = mask & 14;
    const int given = bool(mask & 1) + bool(mask & 2) + bool(mask & 4) + bool(mask & 8) + bool(mask & 16);
    if (given < 3 || !heights) continue;
    const ResolvedLayers got = resolve(l, "layers[0]");
    EXPECT_EQ(got.count, n) << mask;
    EXPECT_NEAR(got.first_height, a, 1e-9) << mask;
    EXPECT_NEAR(got.growth, r, 1e-7) << mask;
    EXPECT_NEAR(got.total(), total, 1e-9) << mask;
  }
}

TEST(Resolve, UniformLayersAreUnderstood) {
  LayerSpec l;
  l.first_height = 0.1;
  l.last_height = 0.1;
  l.total_thickness = 0.5;
  EXPECT_EQ(resolve(l, "x").count, 5);
  l = {};
  l.count = 4;
  l.total_thickness = 1;
  l.growth = 1;
  EXPECT_DOUBLE_EQ(resolve(l, "x").first_height, 0.25);
}

TEST(Resolve, TooLittleOrContradictoryIsRefusedByName) {
  const auto refusal = [](const LayerSpec& l) {
    try {
      resolve(l, "layers[2]");
    } catch (const MeshError& e) {
      return e.diagnostic();
    }
    return Diagnostic{};
  };
  LayerSpec l;
  EXPECT_EQ(refusal(l).reason, Reason::SpecInvalid);
  EXPECT_EQ(refusal(l).field, "layers[2]");
  l.count = 3;
  EXPECT_EQ(refusal(l).reason, Reason::SpecInvalid);
  l = layer();
  l.total_thickness = 9;
  EXPECT_NE(refusal(l).message.find("total_thickness 9 contradicts"), std::string::npos);
}

TEST(Check, AGoodSpecificationHasNoFaults) {
  MeshSpec spec;
  spec.sizing.max_size = 0.1;
  spec.layers = {layer({"wing*"}), layer({"inlet"})};
  EXPECT_TRUE(check(spec, kNames).empty());
  EXPECT_TRUE(check(MeshSpec{}, kNames).empty());
}

TEST(Check, MessagesNameTheFieldAndTheNumber) {
  MeshSpec spec;
  spec.layers = {layer({"inlet"}), layer({"outlet"}), layer({"wing*"})};
  spec.layers[2].growth = 0.9;
  EXPECT_EQ(first_message(spec), "layers[2].growth: 0.9 must be at least 1");
  EXPECT_EQ(check(spec, kNames)[0].field, "layers[2].growth");
}

TEST(Check, UnknownPatchesGetADidYouMean) {
  MeshSpec spec;
  spec.layers = {layer({"wing_lift"})};
  EXPECT_EQ(first_message(spec), "layers[0].patches[0]: no patch is called \"wing_lift\"; did you mean \"wing_left\"?");
  spec.layers = {layer({"Inlet"})};
  EXPECT_NE(first_message(spec).find("\"inlet\"?"), std::string::npos);
  spec.layers = {layer({"zebra"})};
  EXPECT_NE(first_message(spec).find("the surface has \"inlet\""), std::string::npos);
  EXPECT_EQ(check(spec, kNames)[0].reason, Reason::PatchUnknown);
}

TEST(Check, APatchInTwoEntriesIsAFaultUnlessTheSidesDiffer) {
  MeshSpec spec;
  spec.layers = {layer({"wing*"}), layer({"*_left"})};
  ASSERT_EQ(check(spec, kNames).size(), 1u);
  EXPECT_EQ(check(spec, kNames)[0].reason, Reason::PatchInTwoLayerEntries);
  EXPECT_EQ(check(spec, kNames)[0].patch, "wing_left");
  spec.layers[0].side = 1;
  spec.layers[1].side = 2;
  EXPECT_TRUE(check(spec, kNames).empty());
}

TEST(Check, EveryNumberOutOfRangeIsFound) {
  const double nan = std::nan("");
  MeshSpec spec;
  spec.volume.mode = VolumeMode::Points;
  spec.sizing.max_size = -1;
  spec.sizing.min_size = nan;
  spec.sizing.patches = {{{"inlet"}, 0}};
  spec.sizing.curvature = 4;
  spec.sizing.gap_cells = 0;
  spec.sizing.boxes = {{Vec3::Ones(), Vec3::Zero(), 1}};
  spec.sizing.spheres = {{Vec3::Zero(), -1, 1}};
  spec.sizing.cylinders = {{Vec3::Zero(), Vec3::Zero(), 1, 1}};
  spec.sizing.gradation = 1;
  spec.sizing.max_cells = 0;
  spec.features.ridge_angle = nan;
  std::vector<std::string> fields;
  for (const Diagnostic& d : check(spec, kNames)) fields.push_back(d.field);
  EXPECT_EQ(fields, (std::vector<std::string>{"volume.points", "sizing.max_size", "sizing.min_size", "sizing.patches[0].size",
                                              "sizing.curvature_deg", "sizing.gap_cells", "sizing.boxes[0]", "sizing.spheres[0].radius",
                                              "sizing.cylinders[0]", "sizing.gradation", "sizing.max_cells", "features.ridge_angle_deg"}));
}

TEST(Check, SizeMapsCurvesAndLevelsMustMakeSense) {
  const auto faults = [](const SizingSpec& sizing) {
    MeshSpec spec;
    spec.sizing = sizing;
    std::vector<std::string> fields;
    for (const Diagnostic& d : check(spec, kNames)) fields.push_back(d.field);
    return fields;
  };
  using Fields = std::vector<std::string>;
  SizingSpec sizing;
  sizing.background = SizeMap{Vec3::Zero(), Vec3::Ones(), {2, 2, 2}, std::vector<double>(8, 0.1)};
  sizing.curves = {{{"inlet"}, 0.1}, {{"inlet", "*"}, 0.2}};
  sizing.min_level = 2;
  sizing.max_level = 2;
  EXPECT_EQ(faults(sizing), Fields{});
  sizing.background->sizes[5] = 0;
  sizing.curves[0] = {{"inlet", "*", "*"}, 0.1};
  sizing.curves[1] = {{"inle"}, -1};
  sizing.min_level = 3;
  EXPECT_EQ(faults(sizing), (Fields{"sizing.curves[0].between", "sizing.curves[1].between[0]", "sizing.curves[1].size",
                                    "sizing.background.sizes[5]", "sizing.min_level"}));
  sizing = {};
  sizing.background = SizeMap{Vec3::Zero(), Vec3::Ones(), {2, 2, 3}, std::vector<double>(8, 0.1)};
  EXPECT_EQ(faults(sizing), Fields{"sizing.background.sizes"});
  sizing.background->counts = {2, 1, 2};
  EXPECT_EQ(faults(sizing), Fields{"sizing.background.counts"});
  sizing.background->counts = {2, 2};
  EXPECT_EQ(faults(sizing), Fields{"sizing.background.counts"});
  sizing = {};
  sizing.max_level = 40;
  EXPECT_EQ(faults(sizing), Fields{"sizing.max_level"});
}

}  // namespace
}  // namespace strata
