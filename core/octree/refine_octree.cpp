// Top-down, breadth-first: every level is a sorted array of nodes with the triangles near each, in compressed rows.
//
// "Near" means that the triangle meets the node's cube inflated by half its edge, which is one block of the next level, or one cell of
// the node itself. So the blocks round the surface, and one ring more on either side, share the surface's level (the carved skin lies
// up to a cell inside), and a leaf with triangles near is a cut leaf.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/octree/mark_outside.h"
#include "core/octree/morton.h"
#include "core/octree/octree.h"
#include "core/octree/split_nodes.h"
#include "core/octree/target_levels.h"
#include "core/octree/triangle_box.h"

namespace strata {
namespace {

constexpr double kInflation = 0.5;        // of the node's edge
constexpr double kOverlapSlack = 1e-9;    // of the root: surfaces that lie on grid planes belong to both sides
constexpr double kSmallTriangle = 0.5;    // of the node's edge: below, the bounding box stands for the triangle

struct Cube {
  Vec3 low;
  double edge;
};

Cube cube_of(const RootCube& root, std::uint64_t code, int level) {
  const GridPoint p = morton_point(code);
  const double edge = std::ldexp(root.size, -level);
  return {root.origin + edge * Vec3(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])), edge};
}

// Which triangles are near which cubes.
class Nearness {
 public:
  Nearness(const Surface& surface, const SizeField& sizes, const RootCube& root)
      : surface_(surface), sizes_(sizes), slack_(kOverlapSlack * root.size) {
    boxes_.resize(surface.triangles.size() + sizes.segments.size());
    parallel_for(boxes_.size(), [&](std::size_t t) {
      for (const Vec3& corner : corners(static_cast<std::int32_t>(t))) boxes_[t].add(corner);
    });
  }

  // Triangles first, then the segments of the size field as triangles without area.
  [[nodiscard]] std::size_t count() const { return boxes_.size(); }

  // Bit c: the triangle is near child c of the cube.
  [[nodiscard]] std::uint8_t children_near(const Cube& parent, std::int32_t triangle) const {
    const Box& box = boxes_[static_cast<std::size_t>(triangle)];
    const double edge = parent.edge / 2;
    const double inflation = kInflation * edge + slack_;
    static constexpr std::array<std::array<unsigned, 2>, 3> kChildren{{{0x55, 0xaa}, {0x33, 0xcc}, {0x0f, 0xf0}}};
    unsigned near = 0xff;
    for (int axis = 0; axis < 3; ++axis) {
      const double low = parent.low[axis] - inflation;
      const double high = parent.low[axis] + edge + inflation;
      unsigned kept = 0;
      if (box.min[axis] <= high && box.max[axis] >= low) kept |= kChildren[static_cast<std::size_t>(axis)][0];
      if (box.min[axis] <= high + edge && box.max[axis] >= low + edge) kept |= kChildren[static_cast<std::size_t>(axis)][1];
      near &= kept;
    }
    if (near == 0 || box.extent().maxCoeff() < kSmallTriangle * edge) return static_cast<std::uint8_t>(near);
    const TriangleAxes axes(corners(triangle));
    for (unsigned child = 0; child < 8; ++child) {
      if (!(near >> child & 1)) continue;
      const Vec3 centre = parent.low + edge * Vec3(0.5 + (child & 1), 0.5 + (child >> 1 & 1), 0.5 + (child >> 2 & 1));
      if (axes.separate(centre, edge / 2 + inflation)) near &= ~(1u << child);
    }
    return static_cast<std::uint8_t>(near);
  }

  [[nodiscard]] bool near(const Cube& cube, std::int32_t triangle) const {
    const Box& box = boxes_[static_cast<std::size_t>(triangle)];
    const double inflation = kInflation * cube.edge + slack_;
    if ((box.min.array() > cube.low.array() + cube.edge + inflation).any() || (box.max.array() < cube.low.array() - inflation).any())
      return false;
    if (box.extent().maxCoeff() < kSmallTriangle * cube.edge) return true;
    return !TriangleAxes(corners(triangle)).separate(cube.low + Vec3::Constant(cube.edge / 2), cube.edge / 2 + inflation);
  }

  [[nodiscard]] bool meets_surface_box(const Cube& cube) const {
    return (cube.low.array() <= surface_.box.max.array() + slack_).all() &&
           (cube.low.array() + cube.edge >= surface_.box.min.array() - slack_).all();
  }

 private:
  [[nodiscard]] std::array<Vec3, 3> corners(std::int32_t triangle) const {
    const auto i = static_cast<std::size_t>(triangle), triangles = surface_.triangles.size();
    if (i < triangles) return surface_.corners(TriangleId(i));
    const SizedSegment& segment = sizes_.segments[i - triangles];
    return {segment.from, segment.to, segment.to};
  }

  const Surface& surface_;
  const SizeField& sizes_;
  double slack_;
  std::vector<Box> boxes_;
};

// Conservative for cylinders: the cube's circumscribed ball stands for it.
bool meets(const SizeSource& source, const Cube& cube) {
  const Vec3 high = cube.low + Vec3::Constant(cube.edge);
  switch (source.shape) {
    case SizeSource::Shape::Box: return (cube.low.array() <= source.b.array()).all() && (high.array() >= source.a.array()).all();
    case SizeSource::Shape::Sphere: return (source.a - source.a.cwiseMax(cube.low).cwiseMin(high)).norm() <= source.radius;
    case SizeSource::Shape::Cylinder: {
      const double ball = 0.5 * std::sqrt(3.0) * cube.edge;
      const double length = (source.b - source.a).norm();
      const Vec3 from_start = 0.5 * (cube.low + high) - source.a;
      if (!(length > 0)) return from_start.norm() <= source.radius + ball;
      const Vec3 axis = (source.b - source.a) / length;
      const double along = axis.dot(from_start);
      return along >= -ball && along <= length + ball && (from_start - along * axis).norm() <= source.radius + ball;
    }
  }
  return false;
}

struct TreeLevel {
  int level = 0;
  std::vector<std::uint64_t> code;
  std::vector<std::int64_t> first;       // rows of `triangle`, one more than nodes
  std::vector<std::int32_t> triangle;
};

// Leaves with triangles near, for marking cut blocks after balance.
struct CutLeaves {
  struct Leaf {
    std::uint64_t key;                   // of the low corner, in finest units
    std::int64_t first, end;             // row of `triangle`
    std::uint8_t level;
  };
  std::vector<Leaf> leaves;
  std::vector<std::int32_t> triangle;
};

struct Refinement {
  SplitNodes split;
  CutLeaves cut;
};

int key_shift(int level) { return 3 * (Octree::kMaxLevel - level); }

std::vector<std::uint8_t> nodes_to_split(const TreeLevel& nodes, const RootCube& root, const Nearness& nearness, const SizeField& sizes,
                                         const TargetLevels& targets) {
  std::vector<std::uint8_t> splits(nodes.code.size(), 0);
  parallel_for(nodes.code.size(), [&](std::size_t n) {
    const auto begin = nodes.triangle.begin() + nodes.first[n];
    const auto end = nodes.triangle.begin() + nodes.first[n + 1];
    const bool surface_asks =
        std::any_of(begin, end, [&](std::int32_t t) { return targets.of_triangle[static_cast<std::size_t>(t)] > nodes.level; });
    if (surface_asks) {
      splits[n] = 1;
      return;
    }
    const Cube cube = cube_of(root, nodes.code[n], nodes.level);
    bool asked = targets.inside_box > nodes.level && nearness.meets_surface_box(cube);
    for (std::size_t s = 0; s < sizes.sources.size() && !asked; ++s)
      asked = targets.of_source[s] > nodes.level && meets(sizes.sources[s], cube);
    if (!asked && !sizes.grid.sizes.empty()) {
      const double size = sizes.grid.smallest_in(cube.low, cube.edge);
      asked = std::isfinite(size) && level_of(size, targets) > nodes.level;
    }
    splits[n] = asked ? 1 : 0;
  });
  return splits;
}

void keep_cut_leaves(const TreeLevel& nodes, const std::vector<std::uint8_t>& splits, CutLeaves& cut) {
  for (std::size_t n = 0; n < nodes.code.size(); ++n) {
    if (splits[n] || nodes.first[n] == nodes.first[n + 1]) continue;
    const auto first = static_cast<std::int64_t>(cut.triangle.size());
    cut.triangle.insert(cut.triangle.end(), nodes.triangle.begin() + nodes.first[n], nodes.triangle.begin() + nodes.first[n + 1]);
    cut.leaves.push_back({nodes.code[n] << key_shift(nodes.level), first, static_cast<std::int64_t>(cut.triangle.size()),
                          static_cast<std::uint8_t>(nodes.level)});
  }
}

TreeLevel children_of(const TreeLevel& nodes, const std::vector<std::size_t>& split, const RootCube& root, const Nearness& nearness) {
  TreeLevel children;
  children.level = nodes.level + 1;
  children.code.resize(8 * split.size());
  children.first.assign(8 * split.size() + 1, 0);
  std::vector<std::uint8_t> near(nodes.triangle.size());  // per entry, the children it goes to
  constexpr std::size_t kNodeGrain = 64;
  parallel_for(
      split.size(),
      [&](std::size_t s) {
        const std::size_t n = split[s];
        const Cube cube = cube_of(root, nodes.code[n], nodes.level);
        const auto first = static_cast<std::size_t>(nodes.first[n]);
        const auto count = static_cast<std::size_t>(nodes.first[n + 1]) - first;
        parallel_for(count, [&](std::size_t i) { near[first + i] = nearness.children_near(cube, nodes.triangle[first + i]); });
        std::array<std::int64_t, 8> counts{};
        for (std::size_t i = first; i < first + count; ++i)
          for (std::size_t c = 0; c < 8; ++c) counts[c] += near[i] >> c & 1;
        for (std::size_t c = 0; c < 8; ++c) {
          children.code[8 * s + c] = nodes.code[n] << 3 | c;
          children.first[8 * s + c] = counts[c];
        }
      },
      kNodeGrain);
  children.triangle.resize(static_cast<std::size_t>(exclusive_scan(children.first)));
  parallel_for(
      split.size(),
      [&](std::size_t s) {
        const std::size_t n = split[s];
        std::array<std::int64_t, 8> at;
        std::copy_n(children.first.begin() + static_cast<std::ptrdiff_t>(8 * s), 8, at.begin());
        for (auto i = static_cast<std::size_t>(nodes.first[n]); i < static_cast<std::size_t>(nodes.first[n + 1]); ++i)
          for (unsigned bits = near[i]; bits != 0; bits &= bits - 1)
            children.triangle[static_cast<std::size_t>(at[static_cast<std::size_t>(__builtin_ctz(bits))]++)] = nodes.triangle[i];
      },
      kNodeGrain);
  return children;
}

// Stops early, with the splits so far, when they alone make more than `most_blocks` leaves (0: no bound).
Refinement refine(const Surface& surface, const SizeField& sizes, const RootCube& root, const TargetLevels& targets,
                  std::int64_t most_blocks, Context& context) {
  const Nearness nearness(surface, sizes, root);
  Refinement result;
  TreeLevel nodes;
  nodes.code = {0};
  nodes.triangle.resize(nearness.count());
  for (std::size_t t = 0; t < nodes.triangle.size(); ++t) nodes.triangle[t] = static_cast<std::int32_t>(t);
  nodes.first = {0, static_cast<std::int64_t>(nodes.triangle.size())};
  while (!nodes.code.empty()) {
    context.checkpoint();
    const std::vector<std::uint8_t> splits = nodes_to_split(nodes, root, nearness, sizes, targets);
    keep_cut_leaves(nodes, splits, result.cut);
    std::vector<std::size_t> split;
    for (std::size_t n = 0; n < splits.size(); ++n)
      if (splits[n]) split.push_back(n);
    if (split.empty()) break;
    std::vector<std::uint64_t>& codes = result.split.emplace_back(split.size());
    for (std::size_t s = 0; s < split.size(); ++s) codes[s] = nodes.code[split[s]];
    if (most_blocks > 0 && leaf_count(result.split) > most_blocks) break;
    nodes = children_of(nodes, split, root, nearness);
  }
  return result;
}

// Balance may have split cut leaves: their parts are asked again.
void mark_cut(Octree& octree, CutLeaves cut, const Surface& surface, const SizeField& sizes, const RootCube& root) {
  const Nearness nearness(surface, sizes, root);
  parallel_sort(cut.leaves.begin(), cut.leaves.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
  parallel_for(octree.block_count(), [&](std::size_t b) {
    auto leaf =
        std::upper_bound(cut.leaves.begin(), cut.leaves.end(), octree.key[b], [](std::uint64_t key, const auto& l) { return key < l.key; });
    if (leaf == cut.leaves.begin()) return;
    --leaf;
    if (octree.key[b] >> key_shift(leaf->level) != leaf->key >> key_shift(leaf->level)) return;
    const int level = octree.level[b];
    const Cube cube = cube_of(root, octree.key[b] >> key_shift(level), level);
    octree.cut[b] = level == leaf->level || std::any_of(cut.triangle.begin() + leaf->first, cut.triangle.begin() + leaf->end,
                                                        [&](std::int32_t t) { return nearness.near(cube, t); });
  });
}

void report_coarsening(double coarsening, std::int64_t max_cells, std::int64_t cells, Context& context) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SizeCoarsened;
  diagnostic.severity = Severity::Warning;
  diagnostic.message = "cells were made " + std::to_string(coarsening) + " times as large as asked for, to stay within " +
                       std::to_string(max_cells) + " cells";
  diagnostic.values = {{"factor", coarsening}, {"max_cells", static_cast<double>(max_cells)}, {"cells", static_cast<double>(cells)}};
  context.adjusted(std::move(diagnostic));
}

void report_clamp(double finest_cell, Context& context) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SizeCoarsened;
  diagnostic.severity = Severity::Warning;
  diagnostic.message = "some sizes asked for are below the finest cells of the octree, which are " + std::to_string(finest_cell) +
                       " of the model's extent; they were raised to it";
  diagnostic.values = {{"finest_cell", finest_cell}};
  context.adjusted(std::move(diagnostic));
}

// r rings of nodes between finer and coarser ones are 4 r cells of the finest, from whose size h to 4 h cells may grow in between.
void smooth_levels(SplitNodes& split, double gradation) {
  constexpr double kByBalance = 1.75;  // what one ring gives
  constexpr int kMostRings = 16;
  if (gradation >= kByBalance) return balance(split);
  grade(split, std::min(kMostRings, static_cast<int>(std::ceil(3 / (4 * (gradation - 1)) - 1e-9))));
}

constexpr int kCellsPerBlock = 8;
constexpr int kStepsPerLevel = 3;  // sizes grow by 2^(1/3) a step
constexpr int kMostSteps = 60;     // a million times larger: a budget too small for any mesh is left to others to refuse

// A tree that is too large before it is as deep as asked needs at least the missing levels' worth of coarsening, less one level since
// the root changes with the sizes.
int steps_to_next_try(const SplitNodes& split, const TargetLevels& targets) {
  int deepest = targets.inside_box;
  for (const std::uint8_t level : targets.of_triangle) deepest = std::max(deepest, int{level});
  for (const std::uint8_t level : targets.of_source) deepest = std::max(deepest, int{level});
  return std::max(1, kStepsPerLevel * (deepest - static_cast<int>(split.size()) - 1));
}

}  // namespace

Octree refine_octree(const Surface& surface, const SizeField& sizes, const OctreeOptions& options, Context& context) {
  const std::int64_t most_blocks = options.max_cells / kCellsPerBlock;
  for (int step = 0;;) {
    const double coarsening = std::exp2(static_cast<double>(step) / kStepsPerLevel);
    const RootCube root = choose_root(surface, sizes, coarsening);
    const TargetLevels targets = target_levels(surface, sizes, coarsening, root.size, std::min(options.max_level, Octree::kMaxLevel));
    Refinement refinement = refine(surface, sizes, root, targets, most_blocks, context);
    context.progress(0.7);
    const bool complete = most_blocks == 0 || leaf_count(refinement.split) <= most_blocks;
    if (complete) smooth_levels(refinement.split, options.gradation);
    const std::int64_t blocks = leaf_count(refinement.split);
    if (most_blocks > 0 && blocks > most_blocks && step < kMostSteps) {
      step += steps_to_next_try(refinement.split, targets);
      continue;
    }

    Octree octree = leaves_of(refinement.split);
    octree.origin = root.origin;
    octree.root_size = root.size;
    mark_cut(octree, std::move(refinement.cut), surface, sizes, root);
    mark_outside(octree, surface);
    if (step > 0) report_coarsening(coarsening, options.max_cells, kCellsPerBlock * blocks, context);
    if (targets.clamped) report_clamp(std::ldexp(root.size, -std::min(options.max_level, Octree::kMaxLevel) - 1), context);
    context.progress(1);
    return octree;
  }
}

}  // namespace strata
