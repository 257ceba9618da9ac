// From wished sizes to octree levels, and the root cube that makes the most wished size come out exactly.
#pragma once

#include <cstdint>
#include <vector>

#include "core/octree/octree.h"
#include "core/sizing/size_field.h"
#include "core/surface/surface.h"

namespace strata {

struct RootCube {
  Vec3 origin = Vec3::Zero();
  double size = 1;
};

// Block levels; a block of level l has cells of size root / 2^(l+1).
struct TargetLevels {
  std::vector<std::uint8_t> of_triangle;  // for blocks near the triangle; never coarser than inside_box; then those of the segments
  std::vector<std::uint8_t> of_source;    // for blocks that meet the source's shape
  int inside_box = 0;                     // for blocks that meet the surface's bounding box: cells within max_size
  int finest = 0;                         // level allowed
  double of_unit_size = 0;                // the level, not rounded, of cells of size 1
  bool clamped = false;                   // some target is finer than the finest level allowed
};

// The level that cells of a size need, to the nearest.
int level_of(double size, const TargetLevels& targets);

// All sizes are multiplied by `coarsening` first. The cube is centred on the surface's box.
RootCube choose_root(const Surface& surface, const SizeField& sizes, double coarsening);

// Targets are met to the nearest level, so within a factor sqrt(2); max_size is kept.
TargetLevels target_levels(const Surface& surface, const SizeField& sizes, double coarsening, double root_size, int finest_level);

}  // namespace strata
