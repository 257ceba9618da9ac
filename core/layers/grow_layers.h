// Boundary layers: groups, sheets, endings, slicing.
#pragma once

#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/features/features.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"
#include "core/spec/mesh_spec.h"

namespace strata {

class Context;

// What grow_layers did, per patch; lengths in the working frame.
struct PatchLayers {
  PatchId patch;
  ResolvedLayers wished;
  int count = 0;                       // of layers delivered; blending not counted
  double first_height_mean = 0;
  double thickness_fraction_mean = 0;  // delivered / wished
  double thickness_fraction_min = 0;
  double coverage = 0;                 // share of the area with all layers or a wedge
};

enum class LayersRung { Full, Thinned, Regrouped, Dropped };

struct GrowResult {
  HexMesh mesh;
  std::vector<PatchLayers> patches;
  LayersRung rung = LayersRung::Full;
};

// Lengths of `layers` in the working frame. `mesh` is valid and labelled; the result is valid too, whatever had to be given up (adjustments
// say what). Attachments of wall vertices are kept; vertices inside layers are Free or held where they lie on an imprinted patch.
GrowResult grow_layers(HexMesh mesh, const std::vector<LayerSpec>& layers, const Ground& ground, Context& context);

}  // namespace strata
