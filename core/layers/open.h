// The first step off the wall: a sheet without thickness gets a little.
#pragma once

#include <vector>

#include "core/layers/growing_sheet.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

// From the ground a held vertex belongs to, to where it is: the fit leaves some vertices off, and layers do not draw them back.
Vec3 off_ground(const HexMesh& mesh, const Ground& ground, VertexId v);

// Lifts the tops of a sheet that has no thickness yet by a small part of the local size, each as far as keeps the hexes round it positive
// (as far as little as it takes). Returns the mesh; `flat` counts hexes that no lift made positive.
struct Opened {
  HexMesh mesh;
  std::vector<VertexId> flat;   // vertices of hexes that are still not positive
};
Opened open_sheet(HexMesh mesh, const GrowingSheet& sheet, const Ground& ground);
// For what open_sheet could not open: lets the tops round the flat places look for room in any direction, off their ground if need be, and
// the volume round them with them.
Opened untangle_opening(Opened opened, const GrowingSheet& sheet, const Ground& ground, Context& context);

}  // namespace strata
