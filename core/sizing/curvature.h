// Sizes that follow from the shape of the surface. Working frame; infinity: no wish.
#pragma once

#include "core/base/ids.h"
#include "core/features/features.h"
#include "core/surface/surface.h"

namespace strata {

// So that the surface turns by at most `angle` (radians) along an element: 2 R sin(angle / 2). Ridges do not count.
IdMap<TriangleId, double> size_by_curvature(const Surface& surface, const Features& features, double angle);

// So that `cells` elements fit across gaps and walls.
IdMap<TriangleId, double> size_by_gaps(const Surface& surface, const Features& features, double cells);

}  // namespace strata
