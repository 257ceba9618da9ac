// Optimising a neighbourhood without changing the shapes its hexes have: thin ones stay thin.
#pragma once

#include <cstdint>

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"
#include "core/optimise/optimise.h"

namespace strata {

class Context;

// Mean edge lengths of each hex along its axes, so that optimising keeps the shapes of layers; an axis without length counts as a little.
IdMap<HexId, HexTarget> proportions(const HexMesh& mesh);

struct Neighbourhood {
  const IdMap<VertexId, std::uint8_t>& seeds;
  const IdMap<VertexId, std::uint8_t>& movable;
  const IdMap<HexId, HexTarget>& targets;
  int rings = 0;  // of vertices round the seeds that take part
  int sweeps = 0;
};
HexMesh optimise_near(HexMesh mesh, const Neighbourhood& near, const Ground& ground, Context& context);

}  // namespace strata
