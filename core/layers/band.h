// The part of a mesh that layers touch: what lies within some rings of hexes of their walls. The rest is left alone.
#pragma once

#include "core/mesh/hex_mesh.h"

namespace strata {

struct Band {
  HexMesh mesh;                              // vertices on its cut faces are Hold::Fixed
  IdMap<VertexId, VertexId> whole_vertex;    // of each vertex of the band
  IdMap<VertexId, Attachment> attachment;    // as in the whole mesh
  HexMesh rest;                              // the whole mesh without the hexes and quads of the band; all its vertices
};

// `wall`: vertices the layers grow from. Hexes, quads and vertices keep their order.
Band cut_band(HexMesh whole, const IdMap<VertexId, std::uint8_t>& wall, int rings);

// Puts the band back after layers grew in it: its first vertices are still those it was cut with, others and all hexes may be new.
// `vertex_in_whole`, if given, receives where each vertex of the band went.
HexMesh join_band(Band band, IdMap<VertexId, VertexId>& vertex_in_whole);

}  // namespace strata
