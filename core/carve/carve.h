// Chooses the hexes to keep: colours regions, carves to a clean manifold skin.
#pragma once

#include <vector>

#include "core/carve/bounds.h"
#include "core/dual/dual.h"
#include "core/mesh/hex_mesh.h"
#include "core/spec/mesh_spec.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"

namespace strata {

class Context;

struct CarveOptions {
  VolumeSpec volume;              // points in the working frame
  // A hex is kept when its centre lies inside by at least this share of the local cell size: room for the buffer layer. Interfaces
  // between two meshed regions need no room.
  double depth = 0.3;
  // Where walls are so near to each other that less than a sheet of hexes would be left, a sheet is kept, whatever its depth.
  bool thin_places = false;
};

struct Carved {
  HexMesh mesh;
  IdMap<TriangleId, Bounds> bounds;  // what the surface's triangles bound
};

// Returns kept hexes with their region; quads hold the skin and the interfaces, oriented as HexMesh asks, unlabelled (patch and chart
// invalid). Each region's boundary is a 2-manifold: one fan of quads round every vertex; hexes with more
// than 3 boundary faces are left only where a region is one cell thick.
// Throws MeshError(InvalidInput, RegionNotFound | SurfaceNotClosed) when nothing is inside or a seed point leaks out, RegionTooThin when
// smaller cells might help.
Carved carve(Dual dual, const Surface& surface, const Locator& locator, const CarveOptions& options, Context& context);

}  // namespace strata
