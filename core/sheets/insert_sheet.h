// The one topological operator: sheet insertion (pillowing) along a set of faces.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/hex_mesh.h"

namespace strata {

// A face of a hex, numbered as in mesh/hex.h.
struct HexFace {
  HexId hex;
  std::int8_t face = 0;
};

// Where a sheet's border runs over the mesh boundary, a strip of new quads appears between old and new vertices. It takes the patch and
// chart of the boundary quad on this side of the border edge.
enum class StripTakes {
  Inner,  // of the quads that keep to the shrunk hexes (growing layers on a group: the neighbour is imprinted)
  Outer,  // of the quads that stay behind (ridge layers: the strip belongs to the neighbour across the ridge)
};

struct SheetRequest {
  // 1: the hex lies on the inner side and is shrunk away from the faces. Sized like mesh.hexes.
  IdMap<HexId, std::uint8_t> inner;
  // The faces to insert along, each given from its inner hex. Every face between an inner and another hex that should be opened, or a
  // boundary face of an inner hex.
  std::vector<HexFace> faces;
  StripTakes strip = StripTakes::Inner;
};

struct Sheet {
  // Per vertex of the mesh before: its inner copy (a new vertex), or invalid when the sheet does not pass it. The old vertex stays with
  // the outer side.
  IdMap<VertexId, VertexId> inner_copy;
  HexId first_hex;       // new hexes are first_hex .. first_hex + faces.size() - 1, in the order of the request's faces; corners 0-3 on
                         // the outer side (face 0), 4-7 on the inner side (face 1): local z points from the face into the inner hex
  QuadId first_strip;    // strips are appended to the quads
};

struct SheetInsertion {
  HexMesh mesh;   // same vertices first, copies appended with equal position and attachment; the new hexes have no thickness yet
  Sheet sheet;
};

// Vertices where the faces' inner hexes are not one face-connected fan (or the outer hexes, when there are any): insertion there would
// break the mesh. Empty: insert_sheet may be called.
std::vector<VertexId> pinched_vertices(const HexMesh& mesh, const SheetRequest& request);

// The faces between inner hexes and others, each given from its inner hex, by ascending hex and face. Boundary faces are not among them.
std::vector<HexFace> faces_between(const HexMesh& mesh, const IdMap<HexId, std::uint8_t>& inner);

// Inserts the sheet. Requires pinched_vertices(...) to be empty. Conforming all-hex result. New hexes take the region of their inner hex and
// layer 0. O(size of the mesh) scan, work proportional to the faces.
SheetInsertion insert_sheet(HexMesh mesh, const SheetRequest& request);

}  // namespace strata
