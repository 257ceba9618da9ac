#include "core/carve/triangle_sides.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/base/context.h"
#include "core/carve/colour.h"
#include "core/dual/dual.h"
#include "core/octree/octree.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

struct Judged {
  Surface surface;
  IdMap<TriangleId, Bounds> bounds;
  [[nodiscard]] Vec3 centre(TriangleId t) const {
    const auto [a, b, c] = surface.corners(t);
    return surface.frame.to_input((a + b + c) / 3);
  }
};
Judged judge(TriangleSoup soup, double size, const VolumeSpec& volume = {}) {
  Context context;
  Surface surface = condition(std::move(soup), context);
  SizeField sizes;
  sizes.max_size = size * surface.frame.scale;
  sizes.at_triangle.assign(surface.triangles.size(), sizes.max_size);
  const Locator locator(surface);
  const Dual dual = dualize(refine_octree(surface, sizes, {}, context), context);
  VolumeSpec work = volume;
  for (Vec3& p : work.points) p = surface.frame.to_work(p);
  NodeColours colours = colour_nodes(dual, surface, locator, work, context);
  return {std::move(surface), std::move(colours.bounds)};
}

TEST(TriangleSides, TheSideThatTwoCubesShareIsAnInterface) {
  const Judged judged = judge(test::touching_cubes(4), 0.15);
  for (TriangleId t : judged.bounds.ids()) {
    const bool shared = std::abs(judged.centre(t).x() - 1) < 1e-6;
    EXPECT_EQ(judged.bounds[t], shared ? Bounds::Interface : Bounds::Wall);
  }
}

TEST(TriangleSides, TrianglesSmallerThanTheCellsFollowTheirNeighbours) {
  const Judged judged = judge(test::sphere(5), 0.3);
  for (TriangleId t : judged.bounds.ids()) EXPECT_EQ(judged.bounds[t], Bounds::Wall);
}

TEST(TriangleSides, ShellsBeyondTheMeshedRegionBoundNothing) {
  const TriangleSoup shells =
      test::joined(test::scaled(test::sphere(3), 0.25), test::joined(test::sphere(3), test::scaled(test::sphere(3), 0.5)));
  const Judged judged = judge(shells, 0.08, {VolumeMode::Points, {Vec3(0, 0.7, 0)}});
  for (TriangleId t : judged.bounds.ids()) EXPECT_EQ(judged.bounds[t], judged.centre(t).norm() < 0.3 ? Bounds::Nothing : Bounds::Wall);
}

// One node that seems to see a wall from behind, out of nowhere.
TEST(TriangleSides, AStrayRayMakesNoHole) {
  Context context;
  const Surface surface = condition(test::cube(4), context);
  std::vector<Sighting> sightings;
  for (TriangleId t : surface.triangles.ids()) {
    for (int i = 0; i < 3; ++i) sightings.push_back({t, 1, kVoid});
    for (int i = 0; i < 3; ++i) sightings.push_back({t, 0, 0});
  }
  const TriangleId stray(17);
  for (Sighting& s : sightings)
    if (s.triangle == stray && s.front == 0) s.colour = kVoid;
  const IdMap<TriangleId, Bounds> bounds = judge_triangles(surface, sightings);
  for (TriangleId t : bounds.ids()) EXPECT_EQ(bounds[t], Bounds::Wall);
}

}  // namespace
}  // namespace strata
