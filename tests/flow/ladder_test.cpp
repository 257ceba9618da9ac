#include "core/ladder.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <set>
#include <stdexcept>

#include "core/buffer/wrap.h"
#include "core/carve/carve.h"
#include "core/dual/dual.h"
#include "core/octree/octree.h"
#include "tests/flow/flow.h"

namespace strata {
namespace {

using testing::kDegree;

MeshError error_of(Failure failure) {
  Diagnostic diagnostic;
  diagnostic.message = "what went wrong";
  return MeshError(failure, diagnostic);
}

TEST(Ladder, CatchesFailuresOfOursOnly) {
  EXPECT_FALSE(failure_of([] {}).has_value());
  EXPECT_EQ(failure_of([] { throw error_of(Failure::Internal); })->message, "what went wrong");
  EXPECT_EQ(failure_of([] { throw std::logic_error("unforeseen"); })->message, "unforeseen");
  for (Failure failure : {Failure::InvalidInput, Failure::LimitExceeded, Failure::Cancelled})
    EXPECT_THROW(failure_of([&] { throw error_of(failure); }), MeshError);
  EXPECT_THROW(failure_of([] { throw std::bad_alloc(); }), std::bad_alloc);
}

struct Carved {
  Surface surface;
  Features features;
  HexMesh mesh;
};
Carved carve_soup(TriangleSoup soup, double size) {
  Context context;
  Surface surface = condition(std::move(soup), context);
  Features features = detect_features(surface, {.ridge_angle = 40 * kDegree}, context);
  SizeField sizes;
  sizes.max_size = size;
  sizes.at_triangle.assign(surface.triangles.size(), size);
  const Locator locator(surface);
  HexMesh mesh = carve(dualize(refine_octree(surface, sizes, {}, context), context), surface, locator, {}, context).mesh;
  return {std::move(surface), std::move(features), std::move(mesh)};
}

TEST(Ladder, TheLastRungsAreAlwaysValid) {
  const std::vector<TriangleSoup> shapes{test::cube(2),          test::rotated(test::cube(2), Vec3(1, 2, 3), 0.7),
                                         test::cylinder(),       test::torus(),
                                         test::sharp_wedge(0.9), test::cone(),
                                         test::sphere_in_box(2), test::touching_cubes(),
                                         test::l_block()};
  for (std::size_t i = 0; i < shapes.size(); ++i)
    for (const double size : {0.09, 0.06}) {
      SCOPED_TRACE("shape " + std::to_string(i) + ", cells of " + std::to_string(size));
      const Carved carved = carve_soup(shapes[i], size);
      const Ground ground(carved.surface, carved.features);
      Context context;
      EXPECT_NO_THROW(require(label_by_nearest(carved.mesh, ground), {.quads_per_hex = 6}));
      const HexMesh stairs = make_staircase(wrap_surface(carved.mesh, context), ground, context);
      EXPECT_NO_THROW(require(stairs));
      EXPECT_NO_THROW(require_no_contacts(stairs));
      const std::set<PatchId> patches(stairs.patch.begin(), stairs.patch.end());
      EXPECT_EQ(patches.size(), carved.surface.patch_names.size());
    }
}

TEST(Ladder, ABrokenPromiseIsNamed) {
  const Carved carved = carve_soup(test::cube(2), 0.2);
  const Ground ground(carved.surface, carved.features);
  HexMesh mesh = label_by_nearest(carved.mesh, ground);
  EXPECT_THROW(require(mesh, {.quads_per_hex = 1}), MeshError);
  std::swap(mesh.hexes[HexId(0)][0], mesh.hexes[HexId(0)][6]);
  EXPECT_THROW(require(mesh, {.quads_per_hex = 6}), MeshError);
}

// Spikes that no mesh of these cells can follow.
TriangleSoup spiked_sphere() {
  TriangleSoup soup = test::sphere(3);
  for (std::size_t p = 0; p < soup.points.size(); p += 53) soup.points[p] *= (p % 2 == 0 ? -0.4 : 1.9);
  return soup;
}

TEST(Ladder, WhatCannotBeFittedStillEndsWithAValidMesh) {
  for (const double size : {0.25, 0.15}) {
    const Outcome outcome = testing::run(spiked_sphere(), testing::sized(size));
    testing::expect_sound(outcome);
    EXPECT_FALSE(outcome.adjustments.empty());
  }
}

TEST(Ladder, CellsThatDoNotFitIntoAThinPlateAreMadeSmaller) {
  const TriangleSoup plate = test::box(Vec3(0, 0, 0), Vec3(1, 1, 0.02));
  const Outcome outcome = testing::run(plate, testing::sized(0.1));
  testing::expect_sound(outcome);
  EXPECT_NEAR(testing::meshed_volume(outcome), 0.02, 0.002);
  const auto told = [](const Diagnostic& d) { return d.reason == Reason::SizeRefined; };
  EXPECT_EQ(std::count_if(outcome.adjustments.begin(), outcome.adjustments.end(), told), 1);
}

TEST(Ladder, LayersOnWhatCannotBeFittedEndWithAValidMesh) {
  const MeshSpec spec = testing::with_layers(testing::sized(0.25), testing::layers_of({"*"}, 3, 0.02));
  const Outcome outcome = testing::run(spiked_sphere(), spec);
  testing::expect_sound(outcome);
  EXPECT_NE(outcome.rung, Rung::Full);
}

// A square that turns, shrinks and rises in slices much thinner than the cells: every slice has a zigzag of sharp creases.
TriangleSoup twisted_horn(int slices, double turn, double top) {
  TriangleSoup soup;
  soup.patch_names = {"horn"};
  for (int i = 0; i <= slices; ++i)
    for (int k = 0; k < 4; ++k) {
      const double at = static_cast<double>(i) / slices, angle = turn * at + (k + 0.5) * 90 * kDegree;
      const double radius = std::sqrt(0.5) * (1 + (top - 1) * at);
      soup.points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 2 * at);
    }
  const auto add = [&](int a, int b, int c) {
    soup.triangles.push_back({a, b, c});
    soup.patch.push_back(0);
  };
  for (int i = 0; i < slices; ++i)
    for (int k = 0; k < 4; ++k) {
      const int a = 4 * i + k, b = 4 * i + (k + 1) % 4;
      add(a, b, a + 4);
      add(b, b + 4, a + 4);
    }
  add(0, 2, 1);
  add(0, 3, 2);
  const int o = 4 * slices;
  add(o, o + 1, o + 2);
  add(o, o + 2, o + 3);
  return soup;
}

TEST(Ladder, CreasesGoBeforeTheMeshLeavesTheSurface) {
  const Outcome outcome = testing::run(twisted_horn(60, -500 * kDegree, 0.2), testing::sized(0.1));
  testing::expect_sound(outcome);
  EXPECT_EQ(outcome.rung, Rung::FeaturesSoftened);
}

}  // namespace
}  // namespace strata
