// Colours the nodes of the dual: which region each lies in, found by flooding along edges that the surface does not cross.
#pragma once

#include <cstdint>

#include "core/carve/bounds.h"
#include "core/dual/dual.h"
#include "core/spec/mesh_spec.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"

namespace strata {

class Context;

inline constexpr std::int32_t kVoid = -1;       // outside, or in a volume that is not meshed
inline constexpr std::int32_t kUndecided = -2;  // on the surface, or in a pocket of a few nodes

struct NodeColours {
  IdMap<VertexId, std::int32_t> colour;         // region, kVoid or kUndecided
  std::int32_t regions = 0;
  IdMap<TriangleId, Bounds> bounds;             // what each triangle of the surface bounds
};

// Throws MeshError(InvalidInput, RegionNotFound) when a seed point is in no bounded region or nothing is bounded, RegionTooThin when that
// may be the cells' fault.
NodeColours colour_nodes(const Dual& dual, const Surface& surface, const Locator& locator, const VolumeSpec& volume, Context& context);

// True when the surface does not cut the segment; a crossing within a hair of either end counts as one.
bool sees(const Locator& locator, const Vec3& from, const Vec3& to);

}  // namespace strata
