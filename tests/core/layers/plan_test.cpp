#include "core/layers/plan.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/layers/facets.h"
#include "tests/core/layers/layer_scene.h"

namespace strata::testing {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

TEST(Meeting, OfTwoLayeredPatchesFollowsTheAngle) {
  EXPECT_EQ(meeting_of_layers(Ending::Auto, Ending::Auto, 90 * kDegree), Meeting::CrossImprint);
  EXPECT_EQ(meeting_of_layers(Ending::Auto, Ending::Auto, 135 * kDegree), Meeting::Regular);
  EXPECT_EQ(meeting_of_layers(Ending::Auto, Ending::Auto, 270 * kDegree), Meeting::Regular);
  EXPECT_EQ(meeting_of_layers(Ending::Wedge, Ending::Imprint, 90 * kDegree), Meeting::CrossImprint);
}

TEST(Meeting, OfTwoLayeredPatchesIsCrossIfEitherAsksElseRegularIfEitherAsks) {
  EXPECT_EQ(meeting_of_layers(Ending::Regular, Ending::CrossImprint, 90 * kDegree), Meeting::CrossImprint);
  EXPECT_EQ(meeting_of_layers(Ending::CrossImprint, Ending::Auto, 140 * kDegree), Meeting::CrossImprint);
  EXPECT_EQ(meeting_of_layers(Ending::Auto, Ending::Regular, 90 * kDegree), Meeting::Regular);
}

TEST(Meeting, NeverCrossesWhereThereIsNoCornerToCross) {
  EXPECT_EQ(meeting_of_layers(Ending::CrossImprint, Ending::CrossImprint, 180 * kDegree), Meeting::Regular);
}

TEST(Meeting, WithABarePatchImprintsSharpAnglesAndWedgesFlatOnes) {
  EXPECT_EQ(meeting_with_bare(Ending::Auto, 90 * kDegree), Meeting::Imprint);
  EXPECT_EQ(meeting_with_bare(Ending::Auto, 180 * kDegree), Meeting::Wedge);
  EXPECT_EQ(meeting_with_bare(Ending::Imprint, 140 * kDegree), Meeting::Imprint);
  EXPECT_EQ(meeting_with_bare(Ending::Imprint, 180 * kDegree), Meeting::Wedge);
  EXPECT_EQ(meeting_with_bare(Ending::Wedge, 90 * kDegree), Meeting::Wedge);
}

TEST(Facets, AnglesOfACubeAreRight) {
  const auto scene = cube_scene(2);
  const JoinedFacets facets(scene->mesh);
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f)) continue;
    for (int e = 0; e < 4; ++e) {
      const FacetNeighbour n = facets.neighbour(f, e);
      ASSERT_NE(n.facet, kNoFacet);
      EXPECT_NEAR(n.angle, facets.front(f) == facets.front(n.facet) ? std::numbers::pi : std::numbers::pi / 2, 1e-12);
    }
  }
}

LayerPlan plan(const LayerScene& scene, const std::vector<LayerSpec>& layers) {
  return plan_layers(scene.mesh, JoinedFacets(scene.mesh), layers, match_patches(layers, scene.surface.patch_names), scene.surface,
                     scene.features, {});
}

TEST(Plan, JoinsWhatMeetsRegularlyAndPartsWhatCrosses) {
  const auto scene = cube_scene(2);
  EXPECT_EQ(plan(*scene, {layers_on({"*"}, 3, 0.01, 1.2, Ending::Regular)}).groups.size(), 1U);
  EXPECT_EQ(plan(*scene, {layers_on({"*"}, 3, 0.01, 1.2, Ending::Auto)}).groups.size(), 6U);
}

TEST(Plan, AJoinedGroupHasTheLargestCount) {
  const auto scene = cube_scene(2);
  const LayerPlan p = plan(*scene, {layers_on({"x_*"}, 3, 0.01, 1.2, Ending::Regular), layers_on({"y_*"}, 5, 0.01, 1.2, Ending::Regular)});
  ASSERT_EQ(p.groups.size(), 1U);
  EXPECT_EQ(p.groups[0].count, 5);
}

TEST(Plan, NeighbourOverridesRule) {
  const auto scene = cube_scene(2);
  LayerSpec x = layers_on({"x_min"}, 3, 0.01, 1.2, Ending::CrossImprint), y = layers_on({"y_min"}, 3, 0.01, 1.2, Ending::Auto);
  x.neighbours.push_back({{"y_*"}, Ending::Regular});
  EXPECT_EQ(plan(*scene, {x, y}).groups.size(), 1U);
}

TEST(Plan, ACircularBorderTakesWedgesAsItIs) {
  const auto scene = cylinder_scene(4, 2, 3);
  const LayerPlan p = plan(*scene, {layers_on({"side"}, 4, 0.01, 1.2, Ending::Wedge)});
  ASSERT_EQ(p.groups.size(), 1U);
  EXPECT_EQ(p.groups[0].wedge_vertices.size(), 32U);
  EXPECT_TRUE(p.want_row.empty());
}

TEST(Plan, ASquareBorderWantsAFreshRowForWedges) {
  const auto scene = cube_scene(3);
  const LayerPlan p = plan(*scene, {layers_on({"z_min"}, 4, 0.01, 1.2, Ending::Wedge)});
  EXPECT_EQ(p.want_row.size(), 1U);
  EXPECT_TRUE(p.groups.at(0).wedge_vertices.empty());
}

}  // namespace
}  // namespace strata::testing
