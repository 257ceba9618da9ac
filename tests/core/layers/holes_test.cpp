#include "core/layers/holes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

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

class LeftOut : public ::testing::TestWithParam<const char*> {};

// In the middle of a side, and round an edge and a corner of the cube that the layers go round.
TEST_P(LeftOut, StaysBareAndTheLayersEndRoundIt) {
  const auto scene = cube_scene(8);
  const std::vector<std::string> sides{"x_min", "x_max", "y_min", "y_max", "z_min", "z_max"};
  const std::vector<LayerSpec> layers{layers_on(sides, 4, 0.005 * scene->surface.frame.scale, 1.2, Ending::Regular)};
  const std::string where = GetParam();
  const Vec3 bad =
      where == "side" ? place(*scene, 0.45, 0.45, 0) : (where == "edge" ? place(*scene, 0.06, 0.45, 0) : place(*scene, 0.06, 0.06, 0));
  const auto wall = wall_of(*scene, sides);
  const auto holes = widened_holes(scene->mesh, wall, {}, {bad});
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
  Grower grower(with->mesh,
                plan_layers(with->mesh, Facets(with->mesh, lessons.bare), layers, wishes, scene->surface, scene->features, lessons),
                request, scene->context);
  ASSERT_EQ(grower.plan.groups.size(), 1U);
  EXPECT_FALSE(grower.plan.groups.front().wedge_vertices.empty());
  ASSERT_TRUE(grower.insert(0));
  grower.collapse_wedges();
  grower.inflate();
  grower.cut();
  EXPECT_EQ(check_topology(grower.mesh), "");
  EXPECT_EQ(check_positive(grower.mesh), "");
  // Nothing is left out but the holes.
  const IdMap<QuadId, QuadSides> sides_of = quad_sides(grower.mesh);
  std::size_t bare = 0;
  for (QuadId q : grower.mesh.quads.ids()) bare += grower.mesh.layer[sides_of[q].back] == 0;
  EXPECT_EQ(bare, holes->size());
}

INSTANTIATE_TEST_SUITE_P(Places, LeftOut, ::testing::Values("side", "edge", "corner"));

}  // namespace
}  // namespace strata::testing
