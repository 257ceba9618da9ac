#include "core/octree/mark_outside.h"

#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/base/parallel.h"
#include "core/octree/block_tree.h"
#include "core/octree/morton.h"
#include "core/surface/locator.h"

namespace strata {
namespace {

constexpr double kClearlyOutside = 0.1;  // winding number; a leak through a hole shows more than this well before the middle of the hole

// The blocks across the six faces that are leaves of the same size or coarser: every pair of neighbours is known to one of the two.
using FaceLeaves = std::array<NodeRef, 6>;

struct Sets {  // disjoint sets of blocks; the root of the tree's border is one more member, the last
  std::vector<std::int32_t> parent;

  explicit Sets(std::size_t count) : parent(count) { std::iota(parent.begin(), parent.end(), 0); }
  std::int32_t root(std::int32_t i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
      auto& p = parent[static_cast<std::size_t>(i)];
      p = parent[static_cast<std::size_t>(p)];
      i = p;
    }
    return i;
  }
  void join(std::int32_t a, std::int32_t b) {
    a = root(a);
    b = root(b);
    parent[static_cast<std::size_t>(std::min(a, b))] = std::max(a, b);
  }
};

std::vector<FaceLeaves> leaves_across_faces(const Octree& octree) {
  std::vector<FaceLeaves> across(octree.block_count());
  for_each_leaf(make_block_tree(octree), [&](std::size_t block, const Neighbourhood& around) {
    across[block] = {around[neighbour_slot(-1, 0, 0)], around[neighbour_slot(1, 0, 0)],  around[neighbour_slot(0, -1, 0)],
                     around[neighbour_slot(0, 1, 0)],  around[neighbour_slot(0, 0, -1)], around[neighbour_slot(0, 0, 1)]};
  });
  return across;
}

Vec3 centre_of(const Octree& octree, std::size_t block) {
  const GridPoint low = morton_point(octree.key[block]);
  const double unit = octree.root_size / static_cast<double>(std::int64_t{1} << Octree::kMaxLevel);
  const Vec3 corner(static_cast<double>(low[0]), static_cast<double>(low[1]), static_cast<double>(low[2]));
  return octree.origin + unit * corner + Vec3::Constant(octree.cell_size(octree.level[block]));
}

}  // namespace

void mark_outside(Octree& octree, const Surface& surface) {
  const std::size_t count = octree.block_count();
  const std::vector<FaceLeaves> across = leaves_across_faces(octree);
  Sets sets(count + 1);
  const auto border = static_cast<std::int32_t>(count);
  for (std::size_t b = 0; b < count; ++b) {
    if (octree.cut[b] != 0) continue;
    for (const NodeRef other : across[b]) {
      if (other == kOutside) sets.join(static_cast<std::int32_t>(b), border);
      else if (is_leaf(other) && octree.cut[leaf_index(other)] == 0)
        sets.join(static_cast<std::int32_t>(b), static_cast<std::int32_t>(leaf_index(other)));
    }
  }
  octree.outside.assign(count, 0);
  for (std::size_t b = 0; b < count; ++b) octree.outside[b] = sets.root(static_cast<std::int32_t>(b)) == border;
  if (surface.closed) return;
  const Locator locator(surface);
  parallel_for(
      count,
      [&](std::size_t b) {
        if (octree.outside[b] != 0 && std::abs(locator.winding_number(centre_of(octree, b))) > kClearlyOutside) octree.outside[b] = 0;
      },
      64);
}

}  // namespace strata
