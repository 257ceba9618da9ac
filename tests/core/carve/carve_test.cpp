#include "core/carve/carve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/buffer/wrap.h"
#include "core/dual/dual.h"
#include "core/octree/octree.h"
#include "tests/support/grids.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

using testing::check_topology;

struct Made {
  Surface surface;
  HexMesh mesh;
  std::vector<Diagnostic> adjustments;
};
Made carve_soup(TriangleSoup soup, int n, const VolumeSpec& volume = {}, double shift = 0.013) {
  Context context;
  Surface surface = condition(std::move(soup), context);
  const Locator locator(surface);
  CarveOptions options;
  options.volume = volume;
  for (Vec3& p : options.volume.points) p = surface.frame.to_work(p);
  HexMesh mesh = carve(testing::uniform_dual(locator, n, Vec3::Constant(shift)), surface, locator, options, context).mesh;
  return {std::move(surface), std::move(mesh), context.adjustments()};
}
std::size_t region_count(const HexMesh& mesh) { return std::set<RegionId>(mesh.region.begin(), mesh.region.end()).size(); }

// A closed shell inside another, both outward: a thick wall with a cavity.
TriangleSoup nested_spheres() { return test::joined(test::sphere(3), test::scaled(test::sphere(3), 0.5)); }

TEST(Carve, KeepsHexesInsideOnlyWithAManifoldSkin) {
  for (int n : {12, 17, 24}) {
    const Made made = carve_soup(test::sphere(3), n);
    EXPECT_EQ(check_topology(made.mesh), "");
    EXPECT_EQ(testing::check_quads_per_hex(made.mesh, 3), "");
    EXPECT_EQ(testing::euler_of_boundary(made.mesh), 2);
    EXPECT_EQ(region_count(made.mesh), 1U);
    const double radius = (made.surface.box.max - made.surface.box.min).maxCoeff() / 2;
    const double full = 4.0 / 3 * std::numbers::pi * std::pow(radius, 3);
    EXPECT_LT(testing::hex_volume(made.mesh), full);
    EXPECT_GT(testing::hex_volume(made.mesh), full * (1 - 4.5 * 1.6 / n));
  }
}

TEST(Carve, SkinsOfManyShapesCanBeWrapped) {
  const std::vector<TriangleSoup> shapes{test::cube(4),
                                         test::rotated(test::cube(3), Vec3(1, 2, 3), 0.7),
                                         test::cylinder(),
                                         test::rotated(test::cylinder(), Vec3(1, 0.3, 0), 0.5),
                                         test::cone(),
                                         test::l_block(),
                                         test::rotated(test::l_block(), Vec3(0.2, 1, 0.4), 0.9),
                                         test::torus(),
                                         test::rotated(test::torus(), Vec3(1, 0.2, 0), 0.6),
                                         test::sharp_wedge(1.0)};
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    for (int n : {14, 18, 25}) {
      SCOPED_TRACE("shape " + std::to_string(i) + ", " + std::to_string(n) + " cells");
      Context context;
      const Made made = carve_soup(shapes[i], n);
      EXPECT_GT(made.mesh.hexes.size(), 0U);
      EXPECT_EQ(check_topology(made.mesh), "");
      EXPECT_EQ(check_topology(wrap_surface(made.mesh, context)), "");
    }
  }
}

TEST(Carve, KeepsTheHoleOfATorus) {
  const Made made = carve_soup(test::torus(), 30);
  EXPECT_EQ(testing::euler_of_boundary(made.mesh), 0);
}

TEST(Carve, HexesAreAsDeepAsAsked) {
  Context context;
  const Made made = carve_soup(test::rotated(test::cube(2), Vec3(1, 2, 3), 0.7), 20);
  const Locator locator(made.surface);
  std::size_t shallow = 0;
  for (const HexVertices& hex : made.mesh.hexes) {
    Vec3 centre = Vec3::Zero();
    for (VertexId v : hex) centre += made.mesh.position[v] / 8;
    EXPECT_GT(locator.winding_number(centre), 0.5);
    if (locator.closest(centre).distance < 0.3 * 1.6 / 20) ++shallow;
  }
  EXPECT_LT(shallow, made.mesh.hexes.size() / 20);  // filled notches only
}

TEST(Carve, MeshesEveryBoundedRegionOfNestedShells) {
  const Made made = carve_soup(nested_spheres(), 28);
  EXPECT_EQ(region_count(made.mesh), 2U);
  EXPECT_EQ(check_topology(made.mesh), "");
}

TEST(Carve, TheOutermostRegionLeavesInnerCavitiesEmpty) {
  const Made made = carve_soup(nested_spheres(), 28, {VolumeMode::Outermost, {}});
  EXPECT_EQ(region_count(made.mesh), 1U);
  EXPECT_EQ(testing::euler_of_boundary(made.mesh), 4);  // two spheres
}

TEST(Carve, SolidIgnoresInnerShells) {
  const Made made = carve_soup(nested_spheres(), 28, {VolumeMode::Solid, {}});
  EXPECT_EQ(region_count(made.mesh), 1U);
  EXPECT_EQ(testing::euler_of_boundary(made.mesh), 2);
}

TEST(Carve, SeedPointsNumberTheirRegionsInOrder) {
  const Made made = carve_soup(nested_spheres(), 28, {VolumeMode::Points, {Vec3(0, 0.8, 0), Vec3(0, 0, 0)}});
  EXPECT_EQ(region_count(made.mesh), 2U);
  for (HexId h : made.mesh.hexes.ids()) {
    Vec3 centre = Vec3::Zero();
    for (VertexId v : made.mesh.hexes[h]) centre += made.mesh.position[v] / 8;
    if (centre.norm() < 0.15) {
      EXPECT_EQ(made.mesh.region[h], RegionId(1));
    }
  }
}

TEST(Carve, OnlyRegionsWithASeedAreMeshed) {
  const Made made = carve_soup(nested_spheres(), 28, {VolumeMode::Points, {Vec3(0, 0.8, 0)}});
  EXPECT_EQ(region_count(made.mesh), 1U);
  EXPECT_EQ(testing::euler_of_boundary(made.mesh), 4);
}

TEST(Carve, RefusesASeedOutside) {
  try {
    carve_soup(test::sphere(2), 14, {VolumeMode::Points, {Vec3(0, 0, 0), Vec3(1.05, 1.05, 1.05)}});
    FAIL() << "no error";
  } catch (const MeshError& error) {
    EXPECT_EQ(error.failure(), Failure::InvalidInput);
    EXPECT_EQ(error.diagnostic().reason, Reason::RegionNotFound);
    EXPECT_EQ(error.diagnostic().field, "volume.points[1]");
  }
}

TEST(Carve, ASharedInterfaceHasMeshOnBothSides) {
  const Made made = carve_soup(test::touching_cubes(4), 30);
  EXPECT_EQ(region_count(made.mesh), 2U);
  EXPECT_EQ(check_topology(made.mesh), "");
  Context context;
  EXPECT_EQ(check_topology(wrap_surface(made.mesh, context)), "");
}

TEST(Carve, NodesThatLieOnTheSurfaceDoNotLeak) {
  // The cube's faces pass through nodes: the box is [-1/2, 1/2]^3 and the spacing 0.1.
  const Made made = carve_soup(test::cube(3), 16, {}, 0.0);
  EXPECT_EQ(check_topology(made.mesh), "");
  EXPECT_EQ(testing::euler_of_boundary(made.mesh), 2);
}

TEST(Carve, AHoleSmallerThanTheCellsCloses) {
  TriangleSoup soup = test::sphere(4);
  soup.triangles.erase(soup.triangles.begin() + 700);
  soup.patch.erase(soup.patch.begin() + 700);
  const Made made = carve_soup(std::move(soup), 16);
  EXPECT_EQ(region_count(made.mesh), 1U);
  EXPECT_EQ(testing::euler_of_boundary(made.mesh), 2);
}

TEST(Carve, AHoleLargerThanTheCellsIsClosedByTheWindingNumber) {
  TriangleSoup soup = test::sphere(4);
  TriangleSoup open = soup;
  open.triangles.clear();
  open.patch.clear();
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    if (soup.points[static_cast<std::size_t>(soup.triangles[t][0])].z() > 0.85) continue;
    open.triangles.push_back(soup.triangles[t]);
    open.patch.push_back(soup.patch[t]);
  }
  const Made made = carve_soup(std::move(open), 24);
  EXPECT_EQ(region_count(made.mesh), 1U);
  EXPECT_EQ(check_topology(made.mesh), "");
  EXPECT_EQ(testing::euler_of_boundary(made.mesh), 2);
  EXPECT_GT(testing::hex_volume(made.mesh), 0.25);
}

TriangleSoup without_top(TriangleSoup soup) {
  std::size_t kept = 0;
  double top = 0;
  for (const Vec3& p : soup.points) top = std::max(top, p.z());
  for (std::size_t t = 0; t < soup.triangles.size(); ++t) {
    const auto on_top = [&](std::int32_t p) { return soup.points[static_cast<std::size_t>(p)].z() > top - 1e-9; };
    if (std::all_of(soup.triangles[t].begin(), soup.triangles[t].end(), on_top)) continue;
    soup.triangles[kept] = soup.triangles[t];
    soup.patch[kept++] = soup.patch[t];
  }
  soup.triangles.resize(kept);
  soup.patch.resize(kept);
  return soup;
}

TEST(Carve, ACubeWithoutItsTopIsRefusedWithThePlaceOfTheHole) {
  for (const VolumeSpec& volume : {VolumeSpec{VolumeMode::All, {}}, VolumeSpec{VolumeMode::Points, {Vec3(0.45, 0.55, 0.5)}}}) {
    const TriangleSoup soup = without_top(test::cube(4));
    Box box;
    for (const Vec3& p : soup.points) box.add(p);
    VolumeSpec inside = volume;
    for (Vec3& p : inside.points) p = box.min + p.cwiseProduct(box.extent());
    try {
      carve_soup(soup, 20, inside);
      FAIL() << "no error";
    } catch (const MeshError& error) {
      EXPECT_EQ(error.failure(), Failure::InvalidInput);
      EXPECT_EQ(error.diagnostic().reason, Reason::SurfaceNotClosed);
      EXPECT_EQ(error.diagnostic().count, 16);
      EXPECT_NEAR(error.diagnostic().box.centre().z(), box.max.z(), 0.1 * box.extent().z());
    }
  }
}

// What is left out of the dual must not be missed, whatever the sizes.
TEST(Carve, BlocksLeftOutOutsideChangeNothing) {
  for (const double finest : {0.02, 0.04}) {
    for (const TriangleSoup& soup : {test::rotated(test::l_block(), Vec3(0.2, 1, 0.4), 0.9), test::torus(), without_top(test::sphere(3))}) {
      Context context;
      const Surface surface = condition(soup, context);
      const Locator locator(surface);
      SizeField sizes;
      sizes.max_size = 0.2;
      sizes.at_triangle = IdMap<TriangleId, double>(surface.triangles.size(), 4 * finest);
      for (std::size_t t = 0; t < surface.triangles.size(); t += 37) sizes.at_triangle[TriangleId(t)] = finest;
      Octree pruned = refine_octree(surface, sizes, {}, context);
      Octree whole = pruned;
      whole.outside.clear();
      Dual small = dualize(std::move(pruned), context), large = dualize(std::move(whole), context);
      EXPECT_LT(small.mesh.hexes.size(), large.mesh.hexes.size());
      const HexMesh a = carve(std::move(small), surface, locator, {}, context).mesh;
      const HexMesh b = carve(std::move(large), surface, locator, {}, context).mesh;
      EXPECT_EQ(a.hexes, b.hexes);
      EXPECT_EQ(a.position, b.position);
      EXPECT_EQ(a.quads, b.quads);
    }
  }
}

}  // namespace
}  // namespace strata
