// What a run will cost, before it is made.
#pragma once

#include <cstdint>

#include "core/mesher.h"
#include "core/octree/octree.h"
#include "core/spec/mesh_spec.h"

namespace strata {

Estimate estimate_of(std::int64_t triangles, const Octree& octree, const MeshSpec& spec);

}  // namespace strata
