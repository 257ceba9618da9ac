// Which blocks lie outside for sure, so that nobody need make cells of them.
#pragma once

#include "core/octree/octree.h"
#include "core/surface/surface.h"

namespace strata {

// Fills Octree::outside: blocks away from the surface that a path of such blocks joins to the root's border. Where the surface is open
// that path may lead through a hole; blocks that the surface winds round are not marked then. Deterministic.
void mark_outside(Octree& octree, const Surface& surface);

}  // namespace strata
