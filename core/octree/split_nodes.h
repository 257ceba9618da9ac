// An octree under construction: which nodes are split. Balance works on this form; the finished Octree is its leaves.
#pragma once

#include <cstdint>
#include <vector>

#include "core/octree/octree.h"

namespace strata {

// split[l]: Morton codes (in units of level l) of the split nodes of level l, sorted and unique. The parent of a split node is split.
using SplitNodes = std::vector<std::vector<std::uint64_t>>;

// Adds the fewest splits after which leaves that share a face or an edge differ by at most one level. (Leaves that share only a
// corner may differ by two; the dual does not mind.) O(n log n), one sweep from fine to coarse.
void balance(SplitNodes& split);

// Balances, and keeps at least `rings` nodes of each level between finer and coarser ones, in every direction.
void grade(SplitNodes& split, int rings);

std::int64_t leaf_count(const SplitNodes& split);

// Fills key and level, in Morton order; cut is all 0.
Octree leaves_of(const SplitNodes& split);

}  // namespace strata
