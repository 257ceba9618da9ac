// What a run will cost, before it is made.
#pragma once

#include <cstdint>

#include "core/mesh/hex_mesh.h"
#include "core/mesher.h"
#include "core/octree/octree.h"
#include "core/spec/mesh_spec.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"

namespace strata {

// From the octree alone, as if layers were wished everywhere: within a factor of two or so. `spec` must have passed check().
Estimate estimate_of(std::int64_t triangles, const Octree& octree, const MeshSpec& spec);

// From the carved cells: the hexes that are kept, one more for every side of a skin quad, and the layers of the patch nearest to it, those that
// lead over to the volume included. Exact but for what ridges add and layers give up.
Estimate count_hexes(Estimate estimate, const HexMesh& carved, const Surface& surface, const Locator& locator, const MeshSpec& spec);

}  // namespace strata
