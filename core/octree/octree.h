// A linear octree of blocks; every leaf block stands for 2x2x2 cells, which makes the octree "paired" for dualisation.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/vec3.h"
#include "core/sizing/size_field.h"
#include "core/surface/surface.h"

namespace strata {

class Context;

// Leaves in Morton order; they tile the root cube. Integer coordinates count finest possible blocks: 0 .. 2^kMaxLevel.
struct Octree {
  static constexpr int kMaxLevel = 20;
  Vec3 origin = Vec3::Zero();           // low corner of the root cube, working frame
  double root_size = 1;                 // edge of the root cube
  std::vector<std::uint64_t> key;       // Morton code (x lowest bit) of the low corner, in units of finest blocks; sorted
  std::vector<std::uint8_t> level;      // edge of the block = root_size / 2^level
  std::vector<std::uint8_t> cut;        // 1: the block, inflated by a cell, meets the surface
  std::vector<std::uint8_t> outside;    // 1: the block lies outside the surface for sure; empty: unknown

  [[nodiscard]] std::size_t block_count() const { return key.size(); }
  [[nodiscard]] double cell_size(int block_level) const { return root_size / static_cast<double>(std::int64_t{2} << block_level); }
};

struct OctreeOptions {
  int max_level = 18;
  double gradation = 2;                 // cells grow by at most (gradation - 1) times the distance; 2 and more: by the balance alone
  std::int64_t max_cells = 0;           // 0: no cap; else sizes are coarsened by factors of 2^(1/3) until the tree fits, and reported
};

// Refines where the size field asks, then balances 2:1 across faces and edges. The root is chosen so that a power of two of the most
// demanding target size fills it, and keeps at least two blocks of margin round the surface. Deterministic.
Octree refine_octree(const Surface& surface, const SizeField& sizes, const OctreeOptions& options, Context& context);

// Leaves visited by neighbour questions: index of the leaf that holds the finest block (x,y,z), or -1 outside the root.
std::int64_t find_leaf(const Octree& octree, std::int64_t x, std::int64_t y, std::int64_t z);

}  // namespace strata
