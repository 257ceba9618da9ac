// The last word on hexes that growing or cutting left not positive: few, and their neighbourhood makes room for them.
#pragma once

#include <vector>

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"
#include "core/optimise/optimise.h"

namespace strata {

class Context;

// Mean edge lengths of each hex along its axes, so that optimising keeps the shapes of layers; an axis without length counts as a little.
IdMap<HexId, HexTarget> proportions(const HexMesh& mesh);

// Hexes that are not positive at a corner or in the middle.
std::vector<HexId> not_positive(const HexMesh& mesh);

enum class Soundness {
  Positive,  // at the corners and in the middle
  ToBeCut,   // everywhere inside, so that equal parts are positive too, and no edge without length
};
// Vertices round hexes that are not sound look for better places: on their ground first, then off features, at last off the surface. `still`
// do not move. Does nothing when there are more than a few; the caller looks again. Attachments stay.
HexMesh heal(HexMesh mesh, const std::vector<VertexId>& still, Soundness goal, const Ground& ground, Context& context);

}  // namespace strata
