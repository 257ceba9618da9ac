// The numbers that come with an optimised mesh. Private to the room.
#pragma once

#include "core/optimise/optimise.h"

namespace strata {

OptimiseResult summarise(HexMesh mesh, const OptimiseRequest& request, int sweeps);

}  // namespace strata
