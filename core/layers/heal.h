// The last word on hexes that growing or cutting left not positive: few, and their neighbourhood makes room for them.
#pragma once

#include <vector>

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

// Hexes that are not positive at a corner or in the middle.
std::vector<HexId> not_positive(const HexMesh& mesh);

enum class Soundness {
  Positive,  // at the corners and in the middle
  ToBeCut,   // everywhere inside, so that equal parts are positive too, and no edge without length
};
// Vertices round hexes that are not sound look for better places: on their ground first, then off features, at last off the surface. `still`
// do not move. Does nothing when there are more than a few; the caller looks again. Attachments stay.
HexMesh heal(HexMesh mesh, const std::vector<VertexId>& still, Soundness goal, const Ground& ground, Context& context);

// The polish sees the corners of hexes only; inside some may lose.
enum class Losses {
  ToBeHealed,  // afterwards
  TakenBack,  // no hex falls under the goal, or under what it was, at its centre either
};
// Raises the scaled Jacobian of hexes under `goal`, when they are few. Before these are cut, what is done to a hex is done to all its
// layers, and their heights are measured afterwards. `still` do not move; held vertices slide.
HexMesh polish_poorest(HexMesh mesh, double goal, Losses losses, const std::vector<VertexId>& still, const Ground& ground,
                       Context& context);

}  // namespace strata
