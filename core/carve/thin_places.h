// Where a region is about as thin as a cell: the hexes that stand for it there, though their centres are near its walls or beyond them.
#pragma once

#include "core/carve/clean_skin.h"
#include "core/carve/colour.h"
#include "core/dual/dual.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"

namespace strata {

struct ThinPlaces {
  const Dual& dual;
  const Surface& surface;
  const Locator& locator;
  const Locator& walls;   // all of the surface but interfaces
  const NodeColours& colours;
};

// Labels hexes between two walls that face each other with less than a clean sheet of hexes between them: those with their centres within
// half a sheet of the middle. Hexes are kept for the region that a node of theirs, or a neighbour that was labelled, sees in the middle.
// Elsewhere nothing changes. Deterministic.
void keep_thin_places(const ThinPlaces& places, HexChoice& choice);

}  // namespace strata
