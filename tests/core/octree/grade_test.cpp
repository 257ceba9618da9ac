#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/octree/morton.h"
#include "core/octree/split_nodes.h"

namespace strata {
namespace {

// A tree that splits down to `depth` round a few random places.
SplitNodes random_tree(std::mt19937& random, int depth) {
  SplitNodes split(static_cast<std::size_t>(depth));
  for (int place = 0; place < 3; ++place) {
    const std::uint64_t code = random() % (std::uint64_t{1} << (3 * depth));
    for (int level = 0; level < depth; ++level) split[static_cast<std::size_t>(level)].push_back(code >> (3 * (depth - level)));
  }
  for (auto& level : split) {
    std::sort(level.begin(), level.end());
    level.erase(std::unique(level.begin(), level.end()), level.end());
  }
  return split;
}

// The gap between two leaves, in finest units, along the axis where it is largest.
std::int64_t gap(const Octree& octree, std::size_t a, std::size_t b) {
  const GridPoint pa = morton_point(octree.key[a]), pb = morton_point(octree.key[b]);
  const std::int64_t ea = std::int64_t{1} << (Octree::kMaxLevel - octree.level[a]),
                     eb = std::int64_t{1} << (Octree::kMaxLevel - octree.level[b]);
  std::int64_t largest = 0;
  for (std::size_t k = 0; k < 3; ++k) largest = std::max({largest, pa[k] - (pb[k] + eb), pb[k] - (pa[k] + ea)});
  return largest;
}

TEST(Grade, KeepsAsManyNodesOfEachLevelAsAskedBetweenFinerAndCoarser) {
  std::mt19937 random(5);
  for (const int rings : {2, 3, 4}) {
    SplitNodes split = random_tree(random, 5);
    grade(split, rings);
    const Octree octree = leaves_of(split);
    for (std::size_t a = 0; a < octree.block_count(); ++a)
      for (std::size_t b = 0; b < octree.block_count(); ++b) {
        if (octree.level[b] + 1 >= octree.level[a]) continue;
        const std::int64_t between = std::int64_t{1} << (Octree::kMaxLevel - octree.level[a] + 1);
        ASSERT_GE(gap(octree, a, b), rings * between)
            << rings << " rings, levels " << int{octree.level[a]} << " and " << int{octree.level[b]};
      }
  }
}

TEST(Grade, MoreRingsMakeMoreLeaves) {
  std::mt19937 random(6);
  const SplitNodes tree = random_tree(random, 6);
  std::int64_t before = 0;
  for (const int rings : {1, 2, 4}) {
    SplitNodes split = tree;
    rings == 1 ? balance(split) : grade(split, rings);
    EXPECT_GT(leaf_count(split), before);
    before = leaf_count(split);
  }
}

}  // namespace
}  // namespace strata
