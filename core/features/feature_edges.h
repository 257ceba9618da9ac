// Which edges of the surface are features, before they become curves.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/ids.h"
#include "core/features/features.h"
#include "core/surface/surface.h"

namespace strata {

// An undirected edge and the triangles on it. `low` < `high`.
struct FeatureEdge {
  PointId low, high;
  TriangleId forward;       // a triangle that runs low -> high; invalid: none
  TriangleId backward;      // a triangle that runs high -> low; invalid: none
  std::int32_t count = 0;   // triangles in all
  double turn = 0;          // signed angle between the normals of two triangles: > 0 convex, < 0 concave; 0 elsewhere
  double doubt = 0;         // by how much float coordinates may have changed `turn`
  double length = 0;
};

// Sorted by (low, high).
std::vector<FeatureEdge> all_edges(const Surface& surface);

enum class EdgeMark : char { Plain, Feature, Rounded };
// Features are patch borders, non-manifold edges, ridges with hysteresis; rounded edges are ridges that are to be none.
std::vector<EdgeMark> mark_features(const Surface& surface, const std::vector<FeatureEdge>& edges, const FeatureOptions& options);

}  // namespace strata
