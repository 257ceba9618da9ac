// A fresh row of quads along the inside of a border, so that layers can run out there in wedges.
#pragma once

#include <optional>
#include <vector>

#include "core/layers/facets.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

// Wraps the hexes that sit on the given fronts (ascending) in a sheet whose strips belong to these fronts: then every vertex of their
// outer border has exactly two of their quads, each with one edge on the border, whatever the corners. One layer of hexes more under the
// fronts. Nothing: the sheet would pinch or leave a hex that is not positive.
std::optional<HexMesh> add_border_row(const HexMesh& mesh, const std::vector<FrontIndex>& fronts, const Ground& ground, Context& context);

// Wraps the hexes that sit on the given quads (ascending) in a sheet whose strips are quads like them: every vertex of the border of what
// was given has exactly two strip quads. Nothing: as above, or one of the quads is on an interface.
std::optional<HexMesh> add_row_round(const HexMesh& mesh, const std::vector<QuadId>& quads, const Ground& ground, Context& context);

}  // namespace strata
