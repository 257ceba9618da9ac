#include <algorithm>

#include "core/octree/morton.h"
#include "core/octree/octree.h"

namespace strata {

std::int64_t find_leaf(const Octree& octree, std::int64_t x, std::int64_t y, std::int64_t z) {
  constexpr std::int64_t kSide = std::int64_t{1} << Octree::kMaxLevel;
  if (x < 0 || y < 0 || z < 0 || x >= kSide || y >= kSide || z >= kSide) return -1;
  const auto after = std::upper_bound(octree.key.begin(), octree.key.end(), morton_code({x, y, z}));
  return static_cast<std::int64_t>(after - octree.key.begin()) - 1;
}

}  // namespace strata
