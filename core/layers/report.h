// What the layers became: figures per patch, and what the user must be told.
#pragma once

#include <vector>

#include "core/layers/grow_layers.h"
#include "core/layers/plan.h"

namespace strata {

// What is known of the wall when the layers are done.
struct GrownWall {
  const LayerPlan* plan;
  IdMap<VertexId, double> fraction;   // of the wished thickness, at the foot of each column; negative: no column there
};

std::vector<PatchLayers> report_patches(const HexMesh& mesh, const GrownWall& wall, const IdMap<PatchId, PatchWish>& wishes);

// LayersThinned for patches well under their wish, LayersDropped for fronts (by FrontIndex) given up and places left out. Places in input
// units.
void tell_adjustments(const HexMesh& mesh, const std::vector<PatchLayers>& patches, const LayerPlan& plan,
                      const std::vector<std::uint8_t>& dropped, const Surface& surface, Context& context);

}  // namespace strata
