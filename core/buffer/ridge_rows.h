// A fresh row of quads beside ridges: what rows round charts and rows beside creases share. Private to the room.
//
// S are the hexes on the inner side of the request; at a vertex v of their border on the surface the sheet makes a copy v'. S keeps v', the
// neighbours keep v, and a strip of quads between v and v' appears.
//
//   outer strip (the usual)                 inner strip (where borders are tangled, and beside creases)
//   S S S S v'=ridge  strip  v  D D D       S S S S v'  strip  v=ridge  D D D
//   the strip is D's: D's quads at          the strip is S's: S's quads at
//   the ridge are new                       the ridge are new
#pragma once

#include "core/features/features.h"
#include "core/mesh/hex_mesh.h"
#include "core/sheets/insert_sheet.h"

namespace strata {

// Inserts the sheet, attaches what left the ridge to what it stands on now, and gives the row thickness where hexes stay positive. Requires
// that the request pinches nowhere.
HexMesh insert_row(HexMesh mesh, const SheetRequest& request, const Features& features);

// Takes hexes near pinches out of the inner side until none is left. False: nothing of the inner side is left, or it still pinches.
bool shrink_from_pinches(const HexMesh& mesh, SheetRequest& request);

}  // namespace strata
