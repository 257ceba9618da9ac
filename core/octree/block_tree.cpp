#include "core/octree/block_tree.h"

namespace strata {
namespace {

// Leaves come in depth-first order, so the tree is read off them in one pass.
NodeRef read_node(const Octree& octree, int level, std::size_t& next, std::vector<std::array<NodeRef, 8>>& children) {
  if (octree.level[next] == level) return ~static_cast<NodeRef>(next++);
  const NodeRef node = static_cast<NodeRef>(children.size());
  children.emplace_back();
  for (std::size_t child = 0; child < 8; ++child) {
    const NodeRef ref = read_node(octree, level + 1, next, children);
    children[static_cast<std::size_t>(node)][child] = ref;
  }
  return node;
}

// A child's neighbour is a child of the parent's neighbour.
struct Step {
  std::uint8_t parent_slot = 0;
  std::uint8_t child = 0;
};
constexpr std::array<std::array<Step, 27>, 8> make_steps() {
  std::array<std::array<Step, 27>, 8> steps{};
  for (int child = 0; child < 8; ++child) {
    for (int slot = 0; slot < 27; ++slot) {
      const int digit[3] = {slot % 3, slot / 3 % 3, slot / 9};
      int parent_slot = 0;
      int of_child = 0;
      int weight = 1;
      for (int axis = 0; axis < 3; ++axis) {
        const int at = (child >> axis & 1) + digit[axis] - 1;  // -1..2: in half regions of the parent
        parent_slot += weight * (at < 0 ? 0 : at > 1 ? 2 : 1);
        of_child |= (at & 1) << axis;
        weight *= 3;
      }
      steps[static_cast<std::size_t>(child)][static_cast<std::size_t>(slot)] = {static_cast<std::uint8_t>(parent_slot),
                                                                                static_cast<std::uint8_t>(of_child)};
    }
  }
  return steps;
}
constexpr auto kSteps = make_steps();

}  // namespace

BlockTree make_block_tree(const Octree& octree) {
  BlockTree tree;
  if (octree.block_count() == 0) return tree;
  tree.children.reserve(octree.block_count() / 7 + 1);
  std::size_t next = 0;
  tree.root = read_node(octree, 0, next, tree.children);
  return tree;
}

Neighbourhood neighbourhood_of_root(const BlockTree& tree) {
  Neighbourhood around;
  around.fill(kOutside);
  around[neighbour_slot(0, 0, 0)] = tree.root;
  return around;
}

Neighbourhood neighbourhood_of_child(const BlockTree& tree, const Neighbourhood& parent, unsigned child) {
  Neighbourhood around;
  const auto& steps = kSteps[child];
  for (std::size_t slot = 0; slot < 27; ++slot) {
    const NodeRef ref = parent[steps[slot].parent_slot];
    around[slot] = is_inner(ref) ? tree.children[static_cast<std::size_t>(ref)][steps[slot].child] : ref;
  }
  return around;
}

std::vector<Neighbourhood> subtrees(const BlockTree& tree) {
  constexpr std::size_t kEnough = 512;  // far more than threads, since subtrees differ in size
  constexpr int kDeepest = 6;
  std::vector<Neighbourhood> nodes;
  if (tree.root != kOutside) nodes.push_back(neighbourhood_of_root(tree));
  for (int level = 0; level < kDeepest && !nodes.empty() && nodes.size() < kEnough; ++level) {
    std::vector<Neighbourhood> finer;
    for (const Neighbourhood& node : nodes) {
      if (!is_inner(node[neighbour_slot(0, 0, 0)])) {
        finer.push_back(node);
        continue;
      }
      for (unsigned child = 0; child < 8; ++child) finer.push_back(neighbourhood_of_child(tree, node, child));
    }
    nodes = std::move(finer);
  }
  return nodes;
}

}  // namespace strata
