// How large cells may be, everywhere: the minimum over all sources, in the working frame.
#pragma once

#include <vector>

#include "core/base/ids.h"
#include "core/base/vec3.h"
#include "core/features/features.h"
#include "core/surface/surface.h"

namespace strata {

class Context;

// Sizes in the working frame; MeshSpec's lengths were scaled by the caller (mesher.cpp).
struct SizeSource {
  enum class Shape { Box, Sphere, Cylinder } shape = Shape::Box;
  Vec3 a = Vec3::Zero();  // box min, sphere centre, cylinder axis start
  Vec3 b = Vec3::Zero();  // box max, unused, cylinder axis end
  double radius = 0;
  double size = 0;
};

struct SizeOptions {
  double max_size = 0;                         // > 0, bound for every cell
  double min_size = 0;                         // 0: no bound
  IdMap<PatchId, double> patch_size;           // target for surface quads; infinity: none
  double curvature = 0;                        // largest turn per element, radians; 0: off
  double gap_cells = 0;                        // 0: off
  std::vector<SizeSource> sources;
};

struct SizeField {
  double max_size = 0;                         // bound: cells are never larger
  double min_size = 0;                         // bound: no source asks for less
  IdMap<TriangleId, double> at_triangle;       // target for cells that meet the triangle; infinity: none
  std::vector<SizeSource> sources;             // targets for cells that meet the shape
};

SizeField make_size_field(const Surface& surface, const Features& features, const SizeOptions& options, Context& context);

}  // namespace strata
