// Creases have the same chart on both sides, so no layer round a chart can give them a row: they get one along their path. Private to the
// room.
#pragma once

#include <vector>

#include "core/buffer/wrap.h"
#include "core/features/features.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

class Context;

// Inserts, on either side of every crease where the path bends (a quad has two edges on it), a row of hexes along the path, so that each quad
// there has one edge on the crease at most. Sides where that would pinch the mesh are left as they are and reported.
HexMesh wrap_creases(HexMesh mesh, const std::vector<CreaseEdge>& creases, const Features& features, Context& context);

}  // namespace strata
