// The inner nodes of an octree, and a walk over its leaves that knows all neighbours without searching.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/parallel.h"
#include "core/octree/octree.h"

namespace strata {

// A node of the tree: an inner node (>= 0), a leaf (~index into Octree::key), or kOutside the root.
using NodeRef = std::int32_t;
inline constexpr NodeRef kOutside = std::numeric_limits<NodeRef>::min();

inline bool is_inner(NodeRef node) { return node >= 0; }
inline bool is_leaf(NodeRef node) { return node < 0 && node != kOutside; }
inline std::size_t leaf_index(NodeRef node) { return static_cast<std::size_t>(~node); }

// The same-size regions round a node and itself: index (dx+1) + 3 (dy+1) + 9 (dz+1). Where the region is not a node, the coarser
// leaf that holds it; an inner node means "finer".
using Neighbourhood = std::array<NodeRef, 27>;
inline constexpr std::size_t neighbour_slot(int dx, int dy, int dz) { return static_cast<std::size_t>(13 + dx + 3 * dy + 9 * dz); }

struct BlockTree {
  std::vector<std::array<NodeRef, 8>> children;  // of inner node i, in Morton order; the root is node 0
  NodeRef root = kOutside;
};
BlockTree make_block_tree(const Octree& octree);

Neighbourhood neighbourhood_of_root(const BlockTree& tree);
Neighbourhood neighbourhood_of_child(const BlockTree& tree, const Neighbourhood& parent, unsigned child);

// Subtrees that together hold all leaves: enough of them to keep many threads busy.
std::vector<Neighbourhood> subtrees(const BlockTree& tree);

template <class Visit>
void visit_leaves(const BlockTree& tree, const Neighbourhood& around, const Visit& visit) {
  const NodeRef node = around[neighbour_slot(0, 0, 0)];
  if (!is_inner(node)) {
    visit(leaf_index(node), around);
    return;
  }
  for (unsigned child = 0; child < 8; ++child) visit_leaves(tree, neighbourhood_of_child(tree, around, child), visit);
}

// visit(leaf index, neighbourhood) for every leaf, in parallel.
template <class Visit>
void for_each_leaf(const BlockTree& tree, const Visit& visit) {
  const std::vector<Neighbourhood> parts = subtrees(tree);
  parallel_for(parts.size(), [&](std::size_t i) { visit_leaves(tree, parts[i], visit); }, 1);
}

}  // namespace strata
