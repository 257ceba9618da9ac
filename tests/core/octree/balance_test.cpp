// Trees without a surface: tiling, balance, neighbours.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "core/octree/block_tree.h"
#include "core/octree/morton.h"
#include "core/octree/split_nodes.h"

namespace strata {
namespace {

SplitNodes random_splits(unsigned seed, std::size_t levels, double chance) {
  std::mt19937 random(seed);
  SplitNodes split(levels);
  split[0] = {0};
  for (std::size_t level = 1; level < levels; ++level)
    for (const std::uint64_t parent : split[level - 1])
      for (std::uint64_t child = 0; child < 8; ++child)
        if (static_cast<double>(random()) < chance * 4294967296.0) split[level].push_back(parent << 3 | child);
  return split;
}

std::int64_t edge_of(const Octree& octree, std::size_t block) { return std::int64_t{1} << (Octree::kMaxLevel - octree.level[block]); }

TEST(Morton, CodesAndPointsAreInverse) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 1000; ++i) {
    const GridPoint p{static_cast<std::int64_t>(random() & 0x1fffff), static_cast<std::int64_t>(random() & 0x1fffff),
                      static_cast<std::int64_t>(random() & 0x1fffff)};
    ASSERT_EQ(morton_point(morton_code(p)), p);
  }
  EXPECT_EQ(morton_code({1, 0, 0}), 1u);
  EXPECT_EQ(morton_code({0, 1, 0}), 2u);
  EXPECT_EQ(morton_code({0, 0, 1}), 4u);
}

TEST(Octree, LeavesTileTheRootExactly) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SplitNodes split = random_splits(seed, 6, 0.25);
    balance(split);
    const Octree octree = leaves_of(split);
    ASSERT_EQ(static_cast<std::int64_t>(octree.block_count()), leaf_count(split));
    std::uint64_t next = 0;  // leaves in Morton order cover the keys without gap or overlap
    for (std::size_t b = 0; b < octree.block_count(); ++b) {
      ASSERT_EQ(octree.key[b], next);
      next += std::uint64_t{1} << (3 * (Octree::kMaxLevel - octree.level[b]));
    }
    ASSERT_EQ(next, std::uint64_t{1} << (3 * Octree::kMaxLevel));
  }
}

TEST(Balance, NeighbouringLeavesDifferByAtMostOneLevel) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    SplitNodes split = random_splits(seed, 5, 0.2);
    balance(split);
    const Octree octree = leaves_of(split);
    for (std::size_t a = 0; a < octree.block_count(); ++a) {
      const GridPoint p = morton_point(octree.key[a]);
      for (std::size_t b = a + 1; b < octree.block_count(); ++b) {
        const GridPoint q = morton_point(octree.key[b]);
        int touching = 0, overlapping = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const std::int64_t low = std::max(p[axis], q[axis]);
          const std::int64_t high = std::min(p[axis] + edge_of(octree, a), q[axis] + edge_of(octree, b));
          touching += low == high;
          overlapping += low < high;
        }
        if (touching + overlapping == 3 && overlapping >= 1) {
          ASSERT_LE(std::abs(octree.level[a] - octree.level[b]), 1) << "leaves " << a << " and " << b;
        }
      }
    }
  }
}

TEST(Balance, OfABalancedTreeAddsNothing) {
  SplitNodes split = random_splits(3, 6, 0.2);
  balance(split);
  SplitNodes again = split;
  balance(again);
  EXPECT_EQ(split, again);
}

TEST(Balance, KeepsEverySplitAsked) {
  const SplitNodes asked = random_splits(4, 6, 0.2);
  SplitNodes split = asked;
  balance(split);
  for (std::size_t level = 0; level < asked.size(); ++level)
    for (const std::uint64_t code : asked[level]) ASSERT_TRUE(std::binary_search(split[level].begin(), split[level].end(), code));
}

TEST(FindLeaf, FindsTheLeafThatHoldsThePoint) {
  SplitNodes split = random_splits(5, 6, 0.25);
  balance(split);
  const Octree octree = leaves_of(split);
  for (std::size_t b = 0; b < octree.block_count(); ++b) {
    const GridPoint p = morton_point(octree.key[b]);
    const std::int64_t last = edge_of(octree, b) - 1;
    ASSERT_EQ(find_leaf(octree, p[0], p[1], p[2]), static_cast<std::int64_t>(b));
    ASSERT_EQ(find_leaf(octree, p[0] + last, p[1] + last, p[2] + last), static_cast<std::int64_t>(b));
  }
  EXPECT_EQ(find_leaf(octree, -1, 0, 0), -1);
  EXPECT_EQ(find_leaf(octree, 0, std::int64_t{1} << Octree::kMaxLevel, 0), -1);
}

TEST(BlockTree, KnowsTheNeighboursOfEveryLeaf) {
  SplitNodes split = random_splits(6, 6, 0.25);
  balance(split);
  const Octree octree = leaves_of(split);
  const BlockTree tree = make_block_tree(octree);
  std::vector<int> visits(octree.block_count(), 0);
  std::vector<int> wrong(octree.block_count(), 0);
  for_each_leaf(tree, [&](std::size_t b, const Neighbourhood& around) {
    ++visits[b];
    const GridPoint p = morton_point(octree.key[b]);
    const std::int64_t edge = edge_of(octree, b);
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const NodeRef ref = around[neighbour_slot(dx, dy, dz)];
          const std::int64_t found = find_leaf(octree, p[0] + dx * edge, p[1] + dy * edge, p[2] + dz * edge);
          if (found < 0) {
            wrong[b] += ref != kOutside;
          } else if (octree.level[static_cast<std::size_t>(found)] > octree.level[b]) {
            wrong[b] += !is_inner(ref);
          } else {
            wrong[b] += !is_leaf(ref) || leaf_index(ref) != static_cast<std::size_t>(found);
          }
        }
      }
    }
  });
  for (std::size_t b = 0; b < octree.block_count(); ++b) {
    ASSERT_EQ(visits[b], 1);
    ASSERT_EQ(wrong[b], 0);
  }
}

}  // namespace
}  // namespace strata
