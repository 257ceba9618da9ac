// A triangulated surface with named patches, welded by construction: vertices are shared, never matched by distance.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace strata::shapes {

using Point = std::array<double, 3>;

struct PatchedSurface {
  std::vector<Point> points;
  std::vector<std::array<int, 3>> triangles;
  std::vector<int> patch_of;  // per triangle, an index into patch_names
  std::vector<std::string> patch_names;

  int add_point(const Point& point);
  int patch(const std::string& name);  // the patch of that name, made when it is new
  void add_triangle(int a, int b, int c, int patch);
  // Split along the shorter diagonal; a quad with two equal neighbouring corners becomes one triangle.
  void add_quad(int a, int b, int c, int d, int patch);
};

void turn_inside_out(PatchedSurface& surface);

// Without the points that no triangle uses.
PatchedSurface compact(const PatchedSurface& surface);

// The surface's edges seen by its triangles. A watertight, oriented surface has all three at zero.
struct EdgeFaults {
  int open = 0;          // used once
  int crowded = 0;       // used more than twice
  int misoriented = 0;   // used twice in the same direction
};
EdgeFaults edge_faults(const PatchedSurface& surface);

// Volume enclosed, positive when the triangles turn outwards.
double enclosed_volume(const PatchedSurface& surface);

enum class FileKind { StlAscii, StlBinary, Obj };
// Throws std::runtime_error when the file cannot be written. Binary STL has no names: all is one patch there.
void write(const PatchedSurface& surface, const std::string& path, FileKind kind);

}  // namespace strata::shapes
