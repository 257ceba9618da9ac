// The conforming all-hex dual of a block octree, by a table of block patterns.
#pragma once

#include <cstdint>

#include "core/mesh/hex_mesh.h"
#include "core/octree/octree.h"

namespace strata {

class Context;

// A dual node is a cell (or a template's sub-cell) of the octree; a dual hex is an interior vertex of it.
struct Dual {
  HexMesh mesh;                               // no quads; region, attachment default; every hex positive (scaled Jacobian > 0.28)
  IdMap<VertexId, float> cell_size;           // edge of the cell the node stands for
  IdMap<VertexId, std::uint8_t> cut;          // 1: the node's block may meet the surface (Octree::cut)
  IdMap<VertexId, std::uint8_t> outside;      // 1: the node lies outside for sure (Octree::outside); empty: unknown
};

// Vertices and hexes come in Morton order of their blocks. Blocks that lie outside are left out, but for those next to others:
// all hexes round every node that is not outside are there.
Dual dualize(Octree octree, Context& context);

}  // namespace strata
