// Dualisation, block by block: a node per sub-cell, a hex per vertex inside the root. A vertex belongs to the block that fills its
// (+,+,+) octant, so that each is met once and no table of all vertices is needed: the other octants belong to the block itself or to
// its seven low neighbours, and what those show at a point stands in their pattern.
#include "core/dual/dual.h"

#include <algorithm>
#include <atomic>
#include <limits>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/dual/transition.h"
#include "core/octree/block_tree.h"
#include "core/octree/morton.h"

namespace strata {
namespace {

// Index = 1 where the neighbour lies on the low side of x, 2: of y, 4: of z; entry 0 is the block itself.
using LowNeighbours = std::array<NodeRef, 8>;

PatternBits bits_of_block(const Neighbourhood& around) {
  const auto finer = [&](int dx, int dy, int dz) { return is_inner(around[neighbour_slot(dx, dy, dz)]); };
  PatternBits bits = 0;
  for (int side = 0; side < 2; ++side) {
    const int d = 2 * side - 1;
    if (finer(d, 0, 0)) bits |= face_bit(side);
    if (finer(0, d, 0)) bits |= face_bit(2 + side);
    if (finer(0, 0, d)) bits |= face_bit(4 + side);
  }
  // An edge is cut as well when only the block across it is finer.
  for (int edge = 0; edge < 4; ++edge) {
    const int s = 2 * (edge & 1) - 1;
    const int t = (edge & 2) - 1;
    if (finer(0, s, t)) bits |= edge_bit(edge);
    if (finer(s, 0, t)) bits |= edge_bit(4 + edge);
    if (finer(s, t, 0)) bits |= edge_bit(8 + edge);
  }
  return with_implied_edges(bits);
}

LowNeighbours low_neighbours(const Neighbourhood& around) {
  LowNeighbours low;
  for (int m = 0; m < 8; ++m) low[static_cast<std::size_t>(m)] = around[neighbour_slot(-(m & 1), -(m >> 1 & 1), -(m >> 2 & 1))];
  return low;
}

// The patterns that occur, and which block has which.
struct Patterns {
  std::vector<Pattern> all;
  std::vector<std::uint16_t> of_block;
  std::uint16_t plain = 0;  // number of the pattern of eight cubes
};

Patterns number_patterns(const std::vector<PatternBits>& bits_of) {
  std::vector<std::uint8_t> occurs(kPatternBitSets, 0);
  occurs[0] = 1;  // the plain pattern is always number 0
  for (const PatternBits bits : bits_of) occurs[bits] = 1;
  std::vector<PatternBits> used;
  std::vector<std::uint16_t> number(kPatternBitSets, 0);  // at most 6,210 patterns are legal
  for (PatternBits bits = 0; bits < kPatternBitSets; ++bits) {
    if (!occurs[bits]) continue;
    number[bits] = static_cast<std::uint16_t>(used.size());
    used.push_back(bits);
  }
  Patterns patterns{solve_patterns(used), std::vector<std::uint16_t>(bits_of.size()), number[0]};
  parallel_for(bits_of.size(), [&](std::size_t b) { patterns.of_block[b] = number[bits_of[b]]; });
  return patterns;
}

// Blocks of which cells are made: all that are not outside, and rings of blocks round these. Empty: all.
// One ring will do: the nodes of hexes that may be kept lie within a cell of the surface, so in blocks that are not outside; the hexes
// round these nodes reach one block further.
constexpr int kRings = 1;
std::vector<std::uint8_t> choose_blocks(const Octree& octree, const BlockTree& tree) {
  std::vector<std::uint8_t> kept;
  if (octree.outside.empty()) return kept;
  kept.resize(octree.block_count());
  for (std::size_t b = 0; b < kept.size(); ++b) kept[b] = octree.outside[b] == 0;
  for (int ring = 0; ring < kRings; ++ring) {
    const std::vector<std::uint8_t> before = kept;
    // Neighbours know each other from the finer side at least. Many may write the same 1.
    const auto keep = [&](std::size_t b) { std::atomic_ref<std::uint8_t>(kept[b]).store(1, std::memory_order_relaxed); };
    for_each_leaf(tree, [&](std::size_t block, const Neighbourhood& around) {
      for (const NodeRef other : around) {
        if (!is_leaf(other)) continue;
        if (before[leaf_index(other)] != 0 && before[block] == 0) keep(block);
        if (before[block] != 0 && before[leaf_index(other)] == 0) keep(leaf_index(other));
      }
    });
  }
  return kept;
}

// The octree with all that dualisation asks of it.
struct Blocks {
  const Octree& octree;
  BlockTree tree;
  std::vector<std::uint8_t> kept;
  std::vector<LowNeighbours> low;
  Patterns patterns;
  [[nodiscard]] bool keeps(std::size_t block) const { return kept.empty() || kept[block] != 0; }
  [[nodiscard]] const Pattern& pattern(std::size_t block) const { return patterns.all[patterns.of_block[block]]; }
};

Blocks look_round(const Octree& octree) {
  Blocks blocks{octree, make_block_tree(octree), {}, std::vector<LowNeighbours>(octree.block_count()), {}};
  blocks.kept = choose_blocks(octree, blocks.tree);
  std::vector<PatternBits> bits(octree.block_count());
  for_each_leaf(blocks.tree, [&](std::size_t block, const Neighbourhood& around) {
    bits[block] = bits_of_block(around);
    blocks.low[block] = low_neighbours(around);
  });
  blocks.patterns = number_patterns(bits);
  return blocks;
}

// The low faces of the root that the block touches: bit per axis.
unsigned root_faces(const LowNeighbours& low) {
  return (low[1] == kOutside ? 1u : 0u) | (low[2] == kOutside ? 2u : 0u) | (low[4] == kOutside ? 4u : 0u);
}
unsigned low_faces(const LatticePoint& p) { return (p.x == 0 ? 1u : 0u) | (p.y == 0 ? 2u : 0u) | (p.z == 0 ? 4u : 0u); }

// A sub-cell, by block and place in the block's pattern.
struct Found {
  std::size_t block;
  std::int8_t cell;
};

// The sub-cell that fills the octant `octant` round the block's point p, in a neighbour of another level.
Found find_in_other_level(const Blocks& blocks, std::size_t block, const LatticePoint& p, unsigned octant, NodeRef neighbour,
                          unsigned across) {
  // In quarters of this block, from the low corner of the same-size region the neighbour stands for.
  GridPoint q{p.x + (across & 1 ? kQuarters : 0), p.y + (across & 2 ? kQuarters : 0), p.z + (across & 4 ? kQuarters : 0)};
  if (!is_inner(neighbour)) {
    // Coarser: move to its low corner, then to its quarters.
    const std::size_t at = leaf_index(neighbour);
    const int shift = blocks.octree.level[block] - blocks.octree.level[at];
    const int size_shift = Octree::kMaxLevel - blocks.octree.level[block];
    const GridPoint own = morton_point(blocks.octree.key[block] >> 3 * size_shift);
    const std::int64_t mask = (std::int64_t{1} << shift) - 1;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const std::int64_t region = own[axis] - (across >> axis & 1);
      q[axis] = ((region & mask) * kQuarters + q[axis]) >> shift;
    }
    return {at, blocks.pattern(at).octant[lattice_index(static_cast<int>(q[0]), static_cast<int>(q[1]), static_cast<int>(q[2]))][octant]};
  }
  while (is_inner(neighbour)) {
    unsigned child = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const bool high = q[axis] > kQuarters / 2 || (q[axis] == kQuarters / 2 && (octant >> axis & 1));
      if (high) child |= 1u << axis;
      q[axis] = 2 * (q[axis] - (high ? kQuarters / 2 : 0));
    }
    neighbour = blocks.tree.children[static_cast<std::size_t>(neighbour)][child];
  }
  const std::size_t at = leaf_index(neighbour);
  return {at, blocks.pattern(at).octant[lattice_index(static_cast<int>(q[0]), static_cast<int>(q[1]), static_cast<int>(q[2]))][octant]};
}

// Found by the octant it fills round the block's point p.
Found find_cell(const Blocks& blocks, std::size_t block, const LatticePoint& p, unsigned octant) {
  const unsigned across = low_faces(p) & ~octant;
  const NodeRef neighbour = blocks.low[block][across];
  if (is_inner(neighbour) || blocks.octree.level[leaf_index(neighbour)] != blocks.octree.level[block])
    return find_in_other_level(blocks, block, p, octant, neighbour, across);
  const std::size_t at = leaf_index(neighbour);
  const std::size_t q =
      lattice_index(p.x + (across & 1 ? kQuarters : 0), p.y + (across & 2 ? kQuarters : 0), p.z + (across & 4 ? kQuarters : 0));
  return {at, blocks.pattern(at).octant[q][octant]};
}

// Blocks round which nothing is missing: neither the root's border nor a block left out.
bool is_surrounded(const Blocks& blocks, std::size_t block) {
  const LowNeighbours& low = blocks.low[block];
  if (root_faces(low) != 0) return false;
  return blocks.kept.empty() || std::all_of(low.begin(), low.end(), [&](NodeRef n) { return is_leaf(n) && blocks.keeps(leaf_index(n)); });
}

// Whether the eight cells round the block's point exist.
bool has_all_cells(const Blocks& blocks, std::size_t block, const LatticePoint& p) {
  if (low_faces(p) & root_faces(blocks.low[block])) return false;
  for (unsigned octant = 0; octant < 8 && !blocks.kept.empty(); ++octant)
    if (!blocks.keeps(find_cell(blocks, block, p, octant).block)) return false;
  return true;
}

std::int64_t hexes_of_block(const Blocks& blocks, std::size_t block) {
  if (!blocks.keeps(block)) return 0;  // it holds the high octant of its points
  const Pattern& pattern = blocks.pattern(block);
  const std::int64_t inside = static_cast<std::int64_t>(pattern.interior.size());
  if (is_surrounded(blocks, block)) return inside + static_cast<std::int64_t>(pattern.owned.size());
  return inside +
         std::count_if(pattern.owned.begin(), pattern.owned.end(), [&](const LatticePoint& p) { return has_all_cells(blocks, block, p); });
}

VertexId node_id(const std::vector<std::int32_t>& first_node, std::size_t block, int cell) { return VertexId(first_node[block] + cell); }

HexVertices hex_at(const Blocks& blocks, const std::vector<std::int32_t>& first_node, std::size_t block, const LatticePoint& p) {
  HexVertices hex;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const Found found = find_cell(blocks, block, p, kOctantOfCorner[corner]);
    hex[corner] = node_id(first_node, found.block, found.cell);
  }
  return hex;
}

// Counts per block turned into offsets.
struct Offsets {
  std::vector<std::int32_t> node, hex;
  std::int64_t nodes = 0, hexes = 0;
};

MeshError too_many_cells(std::int64_t cells) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::CellBudgetExceeded;
  diagnostic.message = "the octree's dual would have " + std::to_string(cells) +
                       " cells; at most 2147483647 can be numbered. Ask for larger cells or set max_cells";
  diagnostic.values = {{"cells", static_cast<double>(cells)}};
  return {Failure::LimitExceeded, std::move(diagnostic)};
}

Offsets offsets_of(const Blocks& blocks) {
  const std::size_t count = blocks.octree.block_count();
  std::vector<std::int64_t> node(count), hex(count);
  parallel_for(count, [&](std::size_t b) {
    node[b] = blocks.keeps(b) ? static_cast<std::int64_t>(blocks.pattern(b).node.size()) : 0;
    hex[b] = hexes_of_block(blocks, b);
  });
  Offsets offsets;
  offsets.nodes = exclusive_scan(node);
  offsets.hexes = exclusive_scan(hex);
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  if (offsets.nodes > kMost || offsets.hexes > kMost) throw too_many_cells(std::max(offsets.nodes, offsets.hexes));
  offsets.node.assign(node.begin(), node.end());
  offsets.hex.assign(hex.begin(), hex.end());
  return offsets;
}

void fill_nodes(const Blocks& blocks, const Offsets& offsets, Dual& dual) {
  const Octree& octree = blocks.octree;
  parallel_for(octree.block_count(), [&](std::size_t b) {
    if (!blocks.keeps(b)) return;
    const GridPoint low = morton_point(octree.key[b]);
    const double unit = octree.root_size / static_cast<double>(std::int64_t{1} << Octree::kMaxLevel);
    const Vec3 corner = octree.origin + unit * Vec3(static_cast<double>(low[0]), static_cast<double>(low[1]), static_cast<double>(low[2]));
    const double cell = octree.cell_size(octree.level[b]);
    VertexId v(offsets.node[b]);
    for (const Vec3& node : blocks.pattern(b).node) {
      dual.mesh.position[v] = corner + 2 * cell * node;
      dual.cell_size[v] = static_cast<float>(cell);
      dual.cut[v] = octree.cut[b];
      if (!octree.outside.empty()) dual.outside[v] = octree.outside[b];
      ++v.value;
    }
  });
}

// Nine blocks in ten stand among plain blocks of their own level.
bool is_plain(const Blocks& blocks, std::size_t block) {
  const std::uint8_t level = blocks.octree.level[block];
  for (const NodeRef neighbour : blocks.low[block]) {
    if (!is_leaf(neighbour)) return false;
    const std::size_t at = leaf_index(neighbour);
    if (!blocks.keeps(at) || blocks.octree.level[at] != level || blocks.patterns.of_block[at] != blocks.patterns.plain) return false;
  }
  return true;
}

// Each axis has three layers of cells: the upper one of the low neighbour, then the block's own two.
void fill_plain_hexes(const Blocks& blocks, const std::vector<std::int32_t>& first_node, std::size_t block, HexVertices* hex) {
  std::array<VertexId, 27> node;
  std::size_t n = 0;
  for (unsigned z = 0; z < 3; ++z) {
    for (unsigned y = 0; y < 3; ++y) {
      for (unsigned x = 0; x < 3; ++x) {
        const unsigned across = (x == 0 ? 1u : 0u) | (y == 0 ? 2u : 0u) | (z == 0 ? 4u : 0u);
        const unsigned cell = (x != 1 ? 1u : 0u) | (y != 1 ? 2u : 0u) | (z != 1 ? 4u : 0u);
        node[n++] = node_id(first_node, leaf_index(blocks.low[block][across]), static_cast<int>(cell));
      }
    }
  }
  for (std::size_t p = 0; p < 8; ++p) {
    const std::size_t low = (p & 1) + 3 * (p >> 1 & 1) + 9 * (p >> 2);
    *hex++ = {node[low], node[low + 1], node[low + 4], node[low + 3], node[low + 9], node[low + 10], node[low + 13], node[low + 12]};
  }
}

void fill_hexes(const Blocks& blocks, const Offsets& offsets, HexMesh& mesh) {
  parallel_for(blocks.octree.block_count(), [&](std::size_t b) {
    if (!blocks.keeps(b)) return;
    if (is_plain(blocks, b)) {
      fill_plain_hexes(blocks, offsets.node, b, mesh.hexes.data() + offsets.hex[b]);
      return;
    }
    const Pattern& pattern = blocks.pattern(b);
    const bool all = is_surrounded(blocks, b);
    HexId hex(offsets.hex[b]);
    for (const auto& cells : pattern.interior) {
      for (std::size_t corner = 0; corner < 8; ++corner) mesh.hexes[hex][corner] = node_id(offsets.node, b, cells[corner]);
      ++hex.value;
    }
    for (const LatticePoint& p : pattern.owned) {
      if (!all && !has_all_cells(blocks, b, p)) continue;
      mesh.hexes[hex] = hex_at(blocks, offsets.node, b, p);
      ++hex.value;
    }
  });
}

}  // namespace

Dual dualize(Octree octree, Context& context) {
  const Blocks blocks = look_round(octree);
  const Offsets offsets = offsets_of(blocks);
  context.progress(0.4, offsets.hexes);

  Dual dual;
  const auto nodes = static_cast<std::size_t>(offsets.nodes);
  const auto hexes = static_cast<std::size_t>(offsets.hexes);
  dual.mesh.position.resize(nodes);
  dual.mesh.attachment.resize(nodes);
  dual.cell_size.resize(nodes);
  dual.cut.resize(nodes);
  if (!octree.outside.empty()) dual.outside.resize(nodes);
  fill_nodes(blocks, offsets, dual);
  context.progress(0.6, offsets.hexes);

  dual.mesh.hexes.resize(hexes);
  dual.mesh.region.resize(hexes);
  dual.mesh.layer.resize(hexes);
  fill_hexes(blocks, offsets, dual.mesh);
  context.progress(1, offsets.hexes);
  return dual;
}

}  // namespace strata
