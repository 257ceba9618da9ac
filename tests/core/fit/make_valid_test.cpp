#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/context.h"
#include "core/buffer/wrap.h"
#include "core/carve/carve.h"
#include "core/dual/dual.h"
#include "core/fit/fit.h"
#include "core/octree/octree.h"
#include "core/optimise/ground.h"
#include "core/sizing/size_field.h"
#include "core/surface/locator.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

// The skin of a small block is to lie on the nearest side of a large cube, which would leave its hexes no volume.
TEST(MakeValid, WhatCannotLieOnTheSurfaceStaysOff) {
  Context context;
  const Surface surface = condition(test::cube(), context);
  const Features features = detect_features(surface, {}, context);
  const Ground ground(surface, features);
  HexMesh mesh = testing::grid(3, 3, 3);
  for (Vec3& p : mesh.position) p = surface.frame.to_work(Vec3(0.4, 0.4, 0) + 0.05 * p);
  for (const QuadVertices& quad : mesh.quads)
    for (VertexId v : quad) mesh.attachment[v] = {Hold::Chart, kWholeSurface};
  for (VertexId v : mesh.position.ids())
    if (mesh.attachment[v].hold != Hold::Free) mesh.position[v] = ground.project(mesh.attachment[v], mesh.position[v]).position;
  ASSERT_FALSE(bad_hexes(mesh).empty());
  const FitResult fit = make_valid(std::move(mesh), ground, context);
  EXPECT_EQ(fit.bad, 0);
  EXPECT_EQ(testing::check_positive(fit.mesh), "");
  EXPECT_GT(fit.relaxed, 0);
  EXPECT_GT(fit.worst_off, 0);
}

// A boulder of 320 triangles: creases that turn by little go in all directions.
TriangleSoup boulder(double waves) {
  TriangleSoup soup = test::sphere(2);
  for (Vec3& p : soup.points) {
    const Vec3 u = p.normalized();
    p = (1 + 0.2 * std::sin(waves * u.x() + 1) * std::sin(waves * u.y() + 2) * std::sin(waves * u.z() + 3)) * u;
  }
  return soup;
}

TEST(MakeValid, PoorHexesCostFaintFeatures) {
  Context context;
  const Surface surface = condition(boulder(6.25), context);
  const Features features = detect_features(surface, {}, context);
  const Ground ground(surface, features);
  SizeField sizes;
  sizes.max_size = 0.06;
  sizes.at_triangle.assign(surface.triangles.size(), sizes.max_size);
  const Locator locator(surface);
  HexMesh mesh = carve(dualize(refine_octree(surface, sizes, {}, context), context), surface, locator, {}, context).mesh;
  mesh = fit_to_smooth(wrap_surface(std::move(mesh), context), ground, surface, false, context).mesh;
  Match match = match_features(std::move(mesh), ground, {}, context);
  mesh = wrap_ridges(std::move(match.mesh), features, match.creases, context);
  mesh = settle_on_features(arrive_at_features(std::move(mesh), ground, context), ground, context);
  ASSERT_LT(worst_jacobian(mesh), 0.3);
  const auto held = std::count_if(mesh.attachment.begin(), mesh.attachment.end(),
                                  [](const Attachment& a) { return a.hold == Hold::Curve || a.hold == Hold::Corner; });
  const FitResult fit = make_valid(std::move(mesh), ground, context);
  EXPECT_EQ(fit.bad, 0);
  EXPECT_GT(worst_jacobian(fit.mesh), 0.3);
  ASSERT_TRUE(fit.let_go.has_value());
  EXPECT_LT(fit.let_go->count, held / 2) << "most of the features stay";
}

}  // namespace
}  // namespace strata
