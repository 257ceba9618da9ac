#include "core/octree/split_nodes.h"

#include <algorithm>
#include <array>

#include "core/base/parallel.h"
#include "core/octree/morton.h"

namespace strata {
namespace {

// A split node's children touch all its face and edge neighbours, so those must exist as nodes: their parents are split. Only
// three of the six faces of a node lie on its parent's hull; hence seven parents, the own one first.
constexpr std::size_t kParents = 7;
constexpr std::uint64_t kNoNode = ~std::uint64_t{0};

std::array<std::uint64_t, kParents> parents_that_must_split(std::uint64_t code, int level) {
  const std::int64_t parents_per_side = std::int64_t{1} << (level - 1);
  const GridPoint parent = morton_point(code >> 3);
  std::array<std::uint64_t, kParents> result{};
  for (unsigned mask = 0; mask < kParents; ++mask) {  // 7 = all three axes would be a corner neighbour
    GridPoint p = parent;
    bool inside = true;
    for (unsigned axis = 0; axis < 3; ++axis) {
      if (!(mask >> axis & 1)) continue;
      p[axis] += (code >> axis & 1) ? 1 : -1;
      inside = inside && p[axis] >= 0 && p[axis] < parents_per_side;
    }
    result[mask] = inside ? morton_code(p) : kNoNode;
  }
  return result;
}

}  // namespace

void balance(SplitNodes& split) {
  for (std::size_t level = split.size(); level-- > 1;) {
    const std::vector<std::uint64_t>& fine = split[level];
    std::vector<std::uint64_t>& coarse = split[level - 1];
    const std::size_t old = coarse.size();
    coarse.resize(old + kParents * fine.size());
    parallel_for(fine.size(), [&](std::size_t i) {
      const auto parents = parents_that_must_split(fine[i], static_cast<int>(level));
      std::copy(parents.begin(), parents.end(), coarse.begin() + static_cast<std::ptrdiff_t>(old + kParents * i));
    });
    parallel_sort(coarse.begin(), coarse.end());
    coarse.erase(std::unique(coarse.begin(), coarse.end()), coarse.end());
    if (!coarse.empty() && coarse.back() == kNoNode) coarse.pop_back();
  }
}

// All nodes within `rings` of a split node must exist, so their parents are split.
void grade(SplitNodes& split, int rings) {
  for (std::size_t level = split.size(); level-- > 1;) {
    const std::int64_t parents_per_side = std::int64_t{1} << (level - 1);
    std::vector<std::uint64_t> fine_parents = split[level];
    // Siblings ask for nearly the same: the whole family is widened at once.
    for (std::uint64_t& code : fine_parents) code >>= 3;
    fine_parents.erase(std::unique(fine_parents.begin(), fine_parents.end()), fine_parents.end());
    const std::int64_t reach = (rings + 1) / 2;  // of the children's rings, in parents
    const std::size_t side = static_cast<std::size_t>(2 * reach + 1), around = side * side * side;
    std::vector<std::uint64_t>& coarse = split[level - 1];
    const std::size_t old = coarse.size();
    coarse.resize(old + around * fine_parents.size());
    parallel_for(fine_parents.size(), [&](std::size_t i) {
      const GridPoint parent = morton_point(fine_parents[i]);
      std::size_t at = old + around * i;
      for (std::int64_t z = -reach; z <= reach; ++z)
        for (std::int64_t y = -reach; y <= reach; ++y)
          for (std::int64_t x = -reach; x <= reach; ++x) {
            const GridPoint p{parent[0] + x, parent[1] + y, parent[2] + z};
            const bool inside = std::all_of(p.begin(), p.end(), [&](std::int64_t c) { return c >= 0 && c < parents_per_side; });
            coarse[at++] = inside ? morton_code(p) : kNoNode;
          }
    });
    parallel_sort(coarse.begin(), coarse.end());
    coarse.erase(std::unique(coarse.begin(), coarse.end()), coarse.end());
    if (!coarse.empty() && coarse.back() == kNoNode) coarse.pop_back();
  }
  balance(split);
}

std::int64_t leaf_count(const SplitNodes& split) {
  std::int64_t count = 1;
  for (const auto& nodes : split) count += 7 * static_cast<std::int64_t>(nodes.size());
  return count;
}

Octree leaves_of(const SplitNodes& split) {
  Octree octree;
  const std::size_t count = static_cast<std::size_t>(leaf_count(split));
  octree.key.reserve(count);
  octree.level.reserve(count);
  std::vector<std::size_t> next(split.size() + 1, 0);  // per level: the first split node not yet met

  // Depth first, siblings in Morton order: every level's split nodes are met in their order.
  std::size_t level = 0;
  std::uint64_t code = 0;
  while (true) {
    if (level < split.size() && next[level] < split[level].size() && split[level][next[level]] == code) {
      ++next[level++];
      code <<= 3;
      continue;
    }
    octree.key.push_back(code << (3 * (static_cast<std::size_t>(Octree::kMaxLevel) - level)));
    octree.level.push_back(static_cast<std::uint8_t>(level));
    while (level > 0 && (code & 7) == 7) {
      code >>= 3;
      --level;
    }
    if (level == 0) break;
    ++code;
  }
  octree.cut.assign(octree.key.size(), 0);
  return octree;
}

}  // namespace strata
