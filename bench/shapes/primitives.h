// Pieces that bodies are put together from.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "bench/shapes/patched_surface.h"

namespace strata::shapes {

// Box faces in the order xmin, xmax, ymin, ymax, zmin, zmax, each named, `segments` along every edge; normals point out of the box.
void add_box(PatchedSurface& surface, const Point& low, const Point& high, const std::array<std::string, 6>& names, int segments);
// The same without one face, counted as the names are. Returns the points round the opening, in the order that a face there would turn.
std::vector<int> add_open_box(PatchedSurface& surface, const Point& low, const Point& high, const std::array<std::string, 6>& names,
                              int segments, int open_face);

// A point of a profile in the half plane (x, r >= 0), and the patch of the stretch from it to the next point.
struct ProfilePoint {
  double x = 0;
  double r = 0;
  std::string patch;
};
// The grid of a surface of revolution about x: ids[i][j] is the point of profile point i at angle j. A profile point with r = 0 has one point.
using RevolvedGrid = std::vector<std::vector<int>>;
RevolvedGrid add_revolved_points(PatchedSurface& surface, const std::vector<ProfilePoint>& profile, const std::vector<double>& angles);
// The band between profile points i and i + 1, columns [from, to). Normals point to the right of the profile as it is walked in the
// half plane: into a body whose outline is walked from nose to tail.
void add_band(PatchedSurface& surface, const RevolvedGrid& grid, int i, int from, int to, int patch);

// n equal steps from a to b, both ends included.
std::vector<double> steps(double a, double b, int n);

}  // namespace strata::shapes
