#include <gtest/gtest.h>

#include "core/base/context.h"
#include "core/fit/fit.h"
#include "core/optimise/ground.h"
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

}  // namespace
}  // namespace strata
