// Which way the cells stand. Cells whose faces lie along those of the part make the better mesh with fewer hexes; where a part stands askew,
// the working frame is turned instead.
#pragma once

#include "core/base/vec3.h"
#include "core/surface/surface.h"

namespace strata {

// Rotation from the working frame to one whose axes lie along most of the surface: rows are the new axes. The identity where the axes as they
// are do about as well, as on surfaces without preferred directions. Of the 24 rotations that put cells the same way, the smallest.
// Deterministic.
Mat3 best_axes(const Surface& surface);

// The same surface in a working frame turned by the rotation, whose rows are the new axes; the identity changes nothing.
Surface turned(Surface surface, const Mat3& axes);

}  // namespace strata
