// The octree round real surfaces.
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/base/context.h"
#include "core/octree/morton.h"
#include "core/octree/octree.h"
#include "core/octree/triangle_box.h"

namespace strata {
namespace {

// A unit sphere by quads of a cube blown up; n x n quads a side.
Surface ball(int n) {
  TriangleSoup soup;
  soup.patch_names = {"wall"};
  for (int side = 0; side < 6; ++side) {
    const int axis = side / 2;
    const auto at = [&](int i, int j) {
      Vec3 p;
      p[axis] = side % 2 ? 1 : -1;
      p[(axis + 1) % 3] = std::tan(M_PI / 4 * (2.0 * i / n - 1)) * (side % 2 ? 1 : -1);
      p[(axis + 2) % 3] = std::tan(M_PI / 4 * (2.0 * j / n - 1));
      return Vec3(p.normalized());
    };
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const auto first = static_cast<std::int32_t>(soup.points.size());
        for (const auto& [di, dj] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) soup.points.push_back(at(i + di, j + dj));
        soup.triangles.push_back({first, first + 1, first + 2});
        soup.triangles.push_back({first, first + 2, first + 3});
        soup.patch.push_back(0);
        soup.patch.push_back(0);
      }
    }
  }
  Context context;
  return condition(std::move(soup), context);
}

SizeField uniform(const Surface& surface, double max_size, double target) {
  SizeField sizes;
  sizes.max_size = max_size;
  sizes.at_triangle = IdMap<TriangleId, double>(surface.triangles.size(), target);
  return sizes;
}

// The leaf that holds a point.
std::size_t leaf_at(const Octree& octree, const Vec3& p) {
  const Vec3 grid = (p - octree.origin) / octree.root_size * static_cast<double>(std::int64_t{1} << Octree::kMaxLevel);
  return static_cast<std::size_t>(find_leaf(octree, static_cast<std::int64_t>(std::floor(grid[0])),
                                            static_cast<std::int64_t>(std::floor(grid[1])),
                                            static_cast<std::int64_t>(std::floor(grid[2]))));
}

double cell_at(const Octree& octree, const Vec3& p) { return octree.cell_size(octree.level[leaf_at(octree, p)]); }

TEST(RefineOctree, GivesSurfaceCellsOfExactlyTheSizeAsked) {
  const Surface surface = ball(12);
  Context context;
  for (const double target : {0.05, 0.031, 0.017}) {
    const Octree octree = refine_octree(surface, uniform(surface, 0.2, target), {}, context);
    for (const TriangleId t : surface.triangles.ids()) {
      const auto c = surface.corners(t);
      const Vec3 middle = (c[0] + c[1] + c[2]) / 3;
      ASSERT_NEAR(cell_at(octree, middle), target, 1e-12);
      ASSERT_EQ(octree.cut[leaf_at(octree, middle)], 1);
      // and a cell and a half to either side
      for (const double side : {-1.5, 1.5}) ASSERT_NEAR(cell_at(octree, middle + side * target * surface.normal[t]), target, 1e-12);
    }
  }
}

TEST(RefineOctree, NeverExceedsTheLargestSizeInsideTheSurface) {
  const Surface surface = ball(12);
  Context context;
  for (const double bound : {0.3, 0.1, 0.07}) {
    const Octree octree = refine_octree(surface, uniform(surface, bound, 0.05), {}, context);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> side(-0.5, 0.5);
    for (int i = 0; i < 2000; ++i) {
      const Vec3 p(side(random), side(random), side(random));
      ASSERT_LE(cell_at(octree, p), bound * (1 + 1e-9));
    }
  }
}

TEST(RefineOctree, MeetsSeveralTargetsWithinAFactorOfRootTwo) {
  const Surface surface = ball(24);
  SizeField sizes = uniform(surface, 0.2, 0.04);
  for (const TriangleId t : surface.triangles.ids())
    if (surface.normal[t].z() > 0.8) sizes.at_triangle[t] = 0.013;
  Context context;
  const Octree octree = refine_octree(surface, sizes, {}, context);
  for (const TriangleId t : surface.triangles.ids()) {
    const auto c = surface.corners(t);
    const double cell = cell_at(octree, (c[0] + c[1] + c[2]) / 3);
    ASSERT_LE(cell, sizes.at_triangle[t] * std::sqrt(2.0) * (1 + 1e-9));
    if (surface.normal[t].z() < 0.0) {
      ASSERT_GE(cell, sizes.at_triangle[t] / std::sqrt(2.0) * (1 - 1e-9));
    }
  }
}

TEST(RefineOctree, MarksExactlyTheBlocksWithinACellOfTheSurface) {
  const Surface surface = ball(16);
  SizeField sizes = uniform(surface, 0.2, 0.06);
  sizes.sources.push_back({SizeSource::Shape::Sphere, Vec3(0.5, 0, 0), Vec3::Zero(), 0.1, 0.015});  // makes balance split cut leaves
  Context context;
  const Octree octree = refine_octree(surface, sizes, {}, context);
  std::size_t cut = 0;
  for (std::size_t b = 0; b < octree.block_count(); ++b) {
    const GridPoint p = morton_point(octree.key[b]);
    const double cell = octree.cell_size(octree.level[b]);
    const double unit = octree.root_size / static_cast<double>(std::int64_t{1} << Octree::kMaxLevel);
    const Vec3 centre =
        octree.origin + unit * Vec3(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])) + Vec3::Constant(cell);
    bool near = false;
    for (const TriangleId t : surface.triangles.ids()) {
      const auto c = surface.corners(t);
      Box box;
      for (const Vec3& q : c) box.add(q);
      const double half = 2 * cell;
      if ((box.min.array() > centre.array() + half).any() || (box.max.array() < centre.array() - half).any()) continue;
      if (!TriangleAxes(c).separate(centre, half)) near = true;
    }
    if (near) {
      ASSERT_EQ(octree.cut[b], 1) << "block " << b;
    }  // never missed
    cut += octree.cut[b];
    // and hardly ever without need: the surface is within two cells of the block
    if (octree.cut[b]) {
      ASSERT_LE(std::abs(centre.norm() - 0.5), (std::sqrt(3.0) * 2 + 1) * cell + 0.01);
    }
  }
  EXPECT_GT(cut, 100u);
}

TEST(RefineOctree, RefinesInsideSources) {
  const Surface surface = ball(8);
  Context context;
  const std::vector<SizeSource> sources{{SizeSource::Shape::Box, Vec3(-0.1, -0.1, -0.1), Vec3(0.1, 0.1, 0.1), 0, 0.02},
                                        {SizeSource::Shape::Sphere, Vec3::Zero(), Vec3::Zero(), 0.1, 0.02},
                                        {SizeSource::Shape::Cylinder, Vec3(-0.2, 0, 0), Vec3(0.2, 0, 0), 0.05, 0.02}};
  for (const SizeSource& source : sources) {
    SizeField sizes = uniform(surface, 0.2, 0.1);
    sizes.sources = {source};
    const Octree octree = refine_octree(surface, sizes, {}, context);
    EXPECT_LE(cell_at(octree, Vec3(0.03, -0.02, 0.01)), 0.02 * std::sqrt(2.0));
    EXPECT_GE(cell_at(octree, Vec3(0, 0.35, 0)), 0.05);
  }
}

TEST(RefineOctree, LeavesTwoBlocksOfMarginRoundTheSurface) {
  const Surface surface = ball(8);
  Context context;
  for (const double target : {0.2, 0.11, 0.04}) {
    const Octree octree = refine_octree(surface, uniform(surface, 0.25, target), {}, context);
    EXPECT_LE(octree.origin.maxCoeff(), surface.box.min.minCoeff() - 4 * target);
    EXPECT_GE(octree.origin.minCoeff() + octree.root_size, surface.box.max.maxCoeff() + 4 * target);
  }
}

TEST(RefineOctree, StaysWithinTheCellBudgetAndSaysSo) {
  const Surface surface = ball(12);
  OctreeOptions options;
  options.max_cells = 100000;
  Context context;
  const Octree octree = refine_octree(surface, uniform(surface, 0.2, 0.005), options, context);
  EXPECT_LE(8 * octree.block_count(), 100000u);
  EXPECT_GE(8 * octree.block_count(), 20000u);
  ASSERT_EQ(context.adjustments().size(), 1u);
  EXPECT_EQ(context.adjustments()[0].reason, Reason::SizeCoarsened);
}

TEST(RefineOctree, FindsItsWayFromAbsurdlySmallSizes) {
  const Surface surface = ball(4);
  OctreeOptions options;
  options.max_cells = 50000;
  Context context;
  const Octree octree = refine_octree(surface, uniform(surface, 0.2, 1e-5), options, context);
  EXPECT_LE(8 * octree.block_count(), 50000u);
  EXPECT_GE(8 * octree.block_count(), 10000u);
}

TEST(RefineOctree, SurvivesABudgetTooSmallForAnyMesh) {
  const Surface surface = ball(4);
  OctreeOptions options;
  options.max_cells = 10;
  Context context;
  EXPECT_GT(refine_octree(surface, uniform(surface, 0.2, 0.05), options, context).block_count(), 0u);
}

TEST(RefineOctree, OfASymmetricSurfaceIsSymmetric) {
  const Surface surface = ball(8);
  Context context;
  const Octree octree = refine_octree(surface, uniform(surface, 0.2, 0.03), {}, context);
  const std::int64_t side = std::int64_t{1} << Octree::kMaxLevel;
  for (std::size_t b = 0; b < octree.block_count(); ++b) {
    const GridPoint p = morton_point(octree.key[b]);
    const std::int64_t edge = std::int64_t{1} << (Octree::kMaxLevel - octree.level[b]);
    const std::int64_t mirror = find_leaf(octree, side - p[0] - edge, p[1], p[2]);
    ASSERT_EQ(octree.level[static_cast<std::size_t>(mirror)], octree.level[b]);
  }
}

TEST(RefineOctree, IsTheSameForAnyThreadCount) {
  const Surface surface = ball(20);
  Context context;
  const SizeField sizes = uniform(surface, 0.2, 0.012);
  const Octree expected = refine_octree(surface, sizes, {}, context);
  for (const std::size_t threads : {1u, 2u, 4u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const Octree octree = refine_octree(surface, sizes, {}, context);
    EXPECT_EQ(octree.key, expected.key);
    EXPECT_EQ(octree.level, expected.level);
    EXPECT_EQ(octree.cut, expected.cut);
  }
}

TEST(TriangleAxes, NeverSeparateACubeThatHoldsAPointOfTheTriangle) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> at(-1, 1);
  const auto point = [&] { return Vec3(at(random), at(random), at(random)); };
  int separated = 0;
  for (int i = 0; i < 20000; ++i) {
    const std::array<Vec3, 3> c{point(), point(), point()};
    const TriangleAxes axes(c);
    double u = 0.5 * (at(random) + 1), v = 0.5 * (at(random) + 1);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3 inside = c[0] + u * (c[1] - c[0]) + v * (c[2] - c[0]);
    ASSERT_FALSE(axes.separate(inside + 0.1 * point(), 0.1 + 1e-12));
    separated += axes.separate(point(), 0.1);
  }
  EXPECT_GT(separated, 10000);
}

}  // namespace
}  // namespace strata
