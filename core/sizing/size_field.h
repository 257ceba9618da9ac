// How large cells may be, everywhere: the minimum over all sources, in the working frame.
#pragma once

#include <array>
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

// A piece of a curve and the size wanted along it.
struct SizedSegment {
  Vec3 from, to;
  double size = 0;
};

// Sizes at the nodes of a regular grid, linear in between.
struct SizeGrid {
  Vec3 min = Vec3::Zero(), max = Vec3::Zero();
  std::array<int, 3> counts{};      // nodes along each axis, 2 at least; 0: no grid
  std::vector<double> sizes;        // x running fastest

  // The smallest size over the part of the cube that lies in the grid; infinity outside.
  [[nodiscard]] double smallest_in(const Vec3& low, double edge) const;
};

struct SizeOptions {
  double max_size = 0;                         // > 0, bound for every cell
  double min_size = 0;                         // 0: no bound
  IdMap<PatchId, double> patch_size;           // target for surface quads; infinity: none
  double curvature = 0;                        // largest turn per element, radians; 0: off
  double gap_cells = 0;                        // 0: off
  std::vector<SizeSource> sources;
  IdMap<CurveId, double> curve_size;           // target along curves; infinity, or empty: none
  SizeGrid grid;
};

struct SizeField {
  double max_size = 0;                         // bound: cells are never larger
  double min_size = 0;                         // bound: no source asks for less
  IdMap<TriangleId, double> at_triangle;       // target for cells that meet the triangle; infinity: none
  std::vector<SizeSource> sources;             // targets for cells that meet the shape
  std::vector<SizedSegment> segments;          // targets for cells that meet the segment, which lies on the surface
  SizeGrid grid;                               // no cell is larger than the grid asks for
};

SizeField make_size_field(const Surface& surface, const Features& features, const SizeOptions& options, Context& context);

}  // namespace strata
