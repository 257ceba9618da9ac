#include "core/layers/holes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "core/layers/border_row.h"
#include "core/layers/facets.h"
#include "core/layers/grower.h"
#include "core/layers/report.h"
#include "core/mesh/adjacency.h"
#include "tests/core/layers/layer_scene.h"
#include "tests/support/mesh_checks.h"

namespace strata::testing {
namespace {

IdMap<QuadId, std::uint8_t> wall_of(const LayerScene& scene, const std::vector<std::string>& patches) {
  IdMap<QuadId, std::uint8_t> wall(scene.mesh.quads.size(), 0);
  for (const std::string& name : patches)
    for (QuadId q : wall.ids())
      if (scene.mesh.patch[q] == scene.patch(name)) wall[q] = 1;
  return wall;
}

Vec3 place(const LayerScene& scene, double x, double y, double z) { return scene.surface.frame.to_work(Vec3(x, y, z)); }

TEST(Holes, AreTheNearestQuadsAndThoseRoundThem) {
  const auto scene = cube_scene(12);
  const IdMap<QuadId, std::uint8_t> wall = wall_of(*scene, {"z_min"});
  const auto one = widened_holes(scene->mesh, wall, {}, {place(*scene, 0.54, 0.54, 0.1), place(*scene, 0.55, 0.55, 0.2)});
  ASSERT_TRUE(one);
  EXPECT_EQ(one->size(), 9U);
  EXPECT_TRUE(std::all_of(one->begin(), one->end(), [&](QuadId q) { return wall[q] == 1; }));
  // The same place again: the hole grows, and is too large now for so small a wall.
  EXPECT_FALSE(widened_holes(scene->mesh, wall, *one, {place(*scene, 0.54, 0.54, 0.1)}));
  const auto all = wall_of(*scene, {"x_min", "x_max", "y_min", "y_max", "z_min", "z_max"});
  const auto more = widened_holes(scene->mesh, all, *one, {place(*scene, 0.54, 0.54, 0.1)});
  ASSERT_TRUE(more);
  EXPECT_EQ(more->size(), 49U);
}

struct Scene {
  const char* name;
  std::vector<std::string> patches;
  Ending ending;
  Vec3 bad;
};
void PrintTo(const Scene& scene, std::ostream* out) { *out << scene.name; }
class LeftOut : public ::testing::TestWithParam<Scene> {};

TEST_P(LeftOut, StaysBareAndTheLayersEndRoundIt) {
  const auto& [name, patches, ending, bad] = GetParam();
  const auto scene = cube_scene(12);
  const std::vector<LayerSpec> layers{layers_on(patches, 4, 0.004 * scene->surface.frame.scale, 1.2, ending)};
  const auto wall = wall_of(*scene, patches);
  const auto holes = widened_holes(scene->mesh, wall, {}, {scene->surface.frame.to_work(bad)});
  ASSERT_TRUE(holes);
  const auto with = with_rows_round(scene->mesh, wall, *holes, scene->ground, scene->context);
  ASSERT_TRUE(with);
  EXPECT_EQ(with->holes, *holes);
  EXPECT_EQ(check_topology(with->mesh), "");
  EXPECT_EQ(check_positive(with->mesh), "");

  PlanLessons lessons;
  lessons.excluded.assign(scene->features.chart_count() * 2, 0);
  lessons.bare = with->holes;
  const auto wishes = match_patches(layers, scene->surface.patch_names);
  const Locator locator(scene->surface);
  const LayerRequest request{layers, wishes, scene->ground, locator, 6, 0.3};
  HexMesh mesh = with->mesh;
  const auto plan = [&] {
    return plan_layers(mesh, JoinedFacets(mesh, lessons.bare), layers, wishes, scene->surface, scene->features, lessons);
  };
  for (const std::vector<FrontIndex>& fronts : plan().want_row) {
    auto with_row = add_border_row(mesh, fronts, scene->ground, scene->context);
    ASSERT_TRUE(with_row);
    mesh = std::move(*with_row);
  }
  Grower grower(mesh, plan(), request, scene->context);
  ASSERT_EQ(grower.plan.groups.size(), 1U);
  EXPECT_TRUE(grower.plan.want_row.empty());
  EXPECT_FALSE(grower.plan.groups.front().wedge_vertices.empty());
  ASSERT_TRUE(grower.insert(0));
  grower.collapse_wedges();
  grower.inflate();
  grower.cut();
  EXPECT_EQ(check_topology(grower.mesh), "");
  EXPECT_EQ(check_positive(grower.mesh), "");
  // Nothing is left out but the holes.
  const IdMap<QuadId, QuadSides> sides = quad_sides(grower.mesh);
  std::size_t bare = 0;
  for (QuadId q : grower.mesh.quads.ids())
    for (const std::string& patch : patches) bare += grower.mesh.patch[q] == scene->patch(patch) && grower.mesh.layer[sides[q].back] == 0;
  EXPECT_EQ(bare, holes->size());
}

const std::vector<std::string> kSides{"x_min", "x_max", "y_min", "y_max", "z_min", "z_max"};

INSTANTIATE_TEST_SUITE_P(Places, LeftOut,
                         ::testing::Values(Scene{"InTheMiddle", kSides, Ending::Regular, Vec3(0.46, 0.46, 0)},
                                           Scene{"RoundAnEdge", kSides, Ending::Regular, Vec3(0.04, 0.46, 0)},
                                           Scene{"RoundACorner", kSides, Ending::Regular, Vec3(0.04, 0.04, 0)},
                                           Scene{"AtABorder", {"z_min"}, Ending::Imprint, Vec3(0.04, 0.46, 0)},
                                           Scene{"BesideABorder", {"z_min"}, Ending::Imprint, Vec3(0.12, 0.46, 0)}),
                         [](const auto& at) { return at.param.name; });

}  // namespace
}  // namespace strata::testing
