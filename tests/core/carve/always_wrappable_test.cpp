// Whatever the surface, the octree or the labels: the skin that carve leaves takes the buffer layer.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/buffer/wrap.h"
#include "core/carve/carve.h"
#include "core/carve/clean_skin.h"
#include "core/dual/dual.h"
#include "core/octree/octree.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

using testing::check_topology;

double uniform(std::mt19937& random, double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
std::size_t below(std::mt19937& random, std::size_t count) { return random() % count; }

TriangleSoup random_shape(std::mt19937& random) {
  const std::vector<TriangleSoup> shapes{test::cube(1),         test::cube(4),          test::cylinder(),   test::cone(),
                                         test::l_block(),       test::torus(),          test::sphere(2),    test::sharp_wedge(0.5),
                                         test::sphere_in_box(), test::touching_cubes(), test::two_patches()};
  TriangleSoup soup = shapes[below(random, shapes.size())];
  if (below(random, 3) == 0) return soup;
  const Vec3 axis(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, 0.1, 1));
  return test::rotated(std::move(soup), axis, uniform(random, 0, 3));
}

// Sizes that differ by up to 8 from patch to patch, or at random triangles.
SizeField random_sizes(const Surface& surface, std::mt19937& random) {
  SizeField sizes;
  sizes.max_size = std::exp2(uniform(random, -4, -2));
  std::vector<double> of_patch;
  for (std::size_t p = 0; p < surface.patch_names.size(); ++p) of_patch.push_back(sizes.max_size * std::exp2(-uniform(random, 0, 2.6)));
  const bool speckled = below(random, 3) == 0;
  sizes.at_triangle.assign(surface.triangles.size(), 0);
  for (TriangleId t : surface.triangles.ids())
    sizes.at_triangle[t] = speckled && below(random, 10) == 0 ? sizes.max_size / 6 : of_patch[surface.patch[t].index()];
  return sizes;
}

TEST(AlwaysWrappable, RandomOctreesOfManyShapes) {
  for (unsigned seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    Context context;
    const Surface surface = condition(random_shape(random), context);
    const Locator locator(surface);
    const SizeField sizes = random_sizes(surface, random);
    CarveOptions options;
    options.depth = uniform(random, 0, 0.6);
    if (below(random, 2) == 0) options.volume.mode = VolumeMode::Solid;
    HexMesh mesh;
    try {
      mesh = carve(dualize(refine_octree(surface, sizes, {}, context), context), surface, locator, options, context).mesh;
    } catch (const MeshError& error) {
      EXPECT_EQ(error.diagnostic().reason, Reason::RegionTooThin);
      continue;
    }
    EXPECT_EQ(check_topology(mesh), "");
    EXPECT_NO_THROW(mesh = wrap_surface(std::move(mesh), context));
  }
}

// The kept cells of a labelled grid.
HexMesh kept_of(const HexMesh& grid, const HexChoice& choice) {
  HexMesh mesh;
  mesh.position = grid.position;
  for (HexId h : grid.hexes.ids()) {
    if (choice.label[h] < 0) continue;
    mesh.hexes.push_back(HexVertices(grid.hexes[h]));
    mesh.region.push_back(RegionId(choice.label[h]));
  }
  mesh.attachment.resize(mesh.position.size());
  mesh.layer.assign(mesh.hexes.size(), 0);
  testing::set_quads(mesh);
  return mesh;
}

TEST(AlwaysWrappable, RandomLabels) {
  for (unsigned seed = 0; seed < 250; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    const int n = 6 + static_cast<int>(below(random, 5));
    HexMesh grid = testing::grid(n, n, n);
    grid.quads.clear();
    const std::size_t regions = 1 + below(random, 4);
    const double kept = uniform(random, 0.3, 1), noise = uniform(random, 0, 1);
    HexChoice choice;
    choice.label.assign(grid.hexes.size(), -1);
    choice.fillable.assign(grid.hexes.size(), -1);
    const auto any_region = [&] { return static_cast<std::int32_t>(below(random, regions)); };
    for (HexId h : grid.hexes.ids()) {
      Vec3 centre = Vec3::Zero();
      for (VertexId v : grid.hexes[h]) centre += grid.position[v] / 8;
      if (centre.minCoeff() < 1 || centre.maxCoeff() > n - 1) continue;  // a rim of void, as the octree leaves it
      const auto slab = static_cast<std::int32_t>(centre.x() / n * static_cast<double>(regions));
      if (uniform(random, 0, 1) < kept) choice.label[h] = uniform(random, 0, 1) < noise ? any_region() : slab;
      if (below(random, 3) == 0) choice.fillable[h] = any_region();
    }
    clean_skin(grid, choice);
    HexMesh mesh = kept_of(grid, choice);
    if (mesh.hexes.empty()) continue;
    EXPECT_EQ(check_topology(mesh), "");
    Context context;
    EXPECT_NO_THROW(mesh = wrap_surface(std::move(mesh), context));
    EXPECT_EQ(check_topology(mesh), "");
  }
}

// The octree of a cube can place nodes on its very faces; they are no region of their own.
TEST(AlwaysWrappable, NodesOnFlatFacesAreNoRegion) {
  Context context;
  const Surface surface = condition(test::scaled(test::cube(1), 4), context);
  const Locator locator(surface);
  SizeField sizes;
  sizes.max_size = 0.2 * surface.frame.scale;
  sizes.at_triangle.assign(surface.triangles.size(), sizes.max_size);
  for (TriangleId t : surface.triangles.ids())
    if (surface.patch_names[surface.patch[t]] == "z_max") sizes.at_triangle[t] = sizes.max_size / 5;
  HexMesh mesh = carve(dualize(refine_octree(surface, sizes, {}, context), context), surface, locator, {}, context).mesh;
  for (RegionId r : mesh.region) ASSERT_EQ(r, RegionId(0));
  EXPECT_EQ(testing::euler_of_boundary(mesh), 2);
  EXPECT_NO_THROW(mesh = wrap_surface(std::move(mesh), context));
}

}  // namespace
}  // namespace strata
