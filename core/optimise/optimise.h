// The one optimiser: moves vertices so that hexes become valid, then good, and held vertices reach and keep their geometry.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/ids.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/grains.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

// Ideal edge lengths of a hex along its local x, y, z (mesh/hex.h). Only ratios matter to the shape energy.
using HexTarget = std::array<float, 3>;

// How held vertices that are off their geometry come to it.
enum class Arrival {
  Gently,  // step by step, never inverting a hex; some may not arrive
  AtOnce,  // all are put there; what that inverts is untangled. Some hexes may stay inverted
};

struct OptimiseOptions {
  int sweeps = 10;  // Gauss-Seidel sweeps at most; stops early when nothing moves. Untangling before them and the last
      // steps of held vertices after them have budgets of their own
  Arrival arrival = Arrival::Gently;
  int rings = -1;  // with `seeds`: how many rings of vertices round them take part; -1: all vertices
  int arrival_sweeps = 20;  // more sweeps at most near held vertices that are still on their way to their geometry
  double power = 3;  // exponent on the mean ratio of each corner: larger looks more at the worst; rounded to a multiple
      // of 3/2 (which needs no cube root)
  bool project = true;  // draw held vertices that are off their geometry towards it, never inverting a hex
  double min_scaled_jacobian = 0.02;  // a projection step may not push a hex that is above this below it
};

// What becomes of vertices of the skin that nothing holds, over openings of the surface.
enum class OpenSkin {
  Moves,   // as the hexes want: it finds its place
  Slides,  // along itself, which keeps the volume: hexes that grow have to grow inwards
};

// Which hexes meet at which vertices, and who may move beside whom: stays as it is while only positions change.
struct Neighbours {
  explicit Neighbours(const HexMesh& mesh);
  void choose(const HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& may_move) { grains = make_grains(mesh, may_move); }

  VertexStars<HexId> star;
  std::vector<std::uint8_t> local;  // beside star.elements: which corner of the hex the vertex is
  Grains grains;                    // of the vertices that may move; none: made anew for each call
};

struct OptimiseRequest {
  const Ground* ground = nullptr;  // null: held vertices do not move at all
  const IdMap<VertexId, std::uint8_t>* movable = nullptr;  // null: all but Corner and Fixed; else 1: may move
  const IdMap<VertexId, std::uint8_t>* seeds = nullptr;  // null: everything
  const IdMap<HexId, HexTarget>* targets = nullptr;  // null: cubes
  OpenSkin open_skin = OpenSkin::Moves;
  const Neighbours* neighbours = nullptr;  // of this mesh, kept from call to call; null: made for this one
};

struct OptimiseResult {
  HexMesh mesh;
  std::int64_t off_ground = 0;  // held vertices that may move, further than 1e-9 (working frame) from their geometry
  int sweeps = 0;
};

// Coloured block-coordinate descent on a regularised mean-ratio energy (docs/flow.md). Hexes that are valid stay valid, unless giving way
// lets more others become so; but for Arrival::AtOnce the count of inverted hexes never grows. Deterministic for any thread count.
OptimiseResult optimise(HexMesh mesh, const OptimiseRequest& request, const OptimiseOptions& options, Context& context);

// What the polish holds against a hex beside its scaled Jacobian, which is blind to lengths.
enum class Regard {
  Angles,          // hardly anything: for layers, which are meant to be thin
  AnglesAndShape,  // that it is flat or long beside its target, too: a scaled Jacobian is not worth a sliver
};

// Worst first: raises the smallest scaled Jacobians one neighbourhood at a time; accepts strict improvement only.
OptimiseResult polish(HexMesh mesh, const OptimiseRequest& request, double goal, int rounds, Context& context,
                      Regard regard = Regard::Angles);

}  // namespace strata
