// Thin solid: the closest place of the surface may be on the far side of it.
#pragma once

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

// Puts boundary vertices whose closest place of the surface looks the other way than their quads do on the place that looks like them, before
// or behind them along the normal of the skin, where there is one near. Vertices of interfaces stay. Which way a component of the surface
// looks is what most vertices say. Deterministic.
void take_own_side(HexMesh& mesh, const Ground& ground);

}  // namespace strata
