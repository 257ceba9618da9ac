// Surfaces put together from rows of points: a strip of triangles lies between two neighbouring rows, and what stands on a surface stands
// on the points of an opening in its rows, so that parts share their points and nothing needs to be cut.
//
//      row k+1   o----o----o----o----o----o          the row of a body where something stands is there twice, `low` and `high`,
//      high      o----o===.o====o.===o----o          sharing its points but for those strictly inside the opening
//      low       same  o===o====o===o  same
//      row k-1   o----o----o----o----o----o
#pragma once

#include <vector>

#include "bench/shapes/patched_surface.h"

namespace strata::shapes {

using Row = std::vector<int>;

Row add_row(PatchedSurface& surface, const std::vector<Point>& points);
// The points of the row, but new ones strictly between `first` and `last`.
Row split_row(PatchedSurface& surface, const Row& row, int first, int last, const std::vector<Point>& points);
Row part_of(const Row& row, int first, int last);  // both included

// Triangles between two rows of equal length; their normal is (along the rows) x (from a to b). Points the rows share make no triangles.
void add_strip(PatchedSurface& surface, const Row& a, const Row& b, int patch);
void add_strip(PatchedSurface& surface, const Row& a, const Row& b, const std::vector<int>& patches);  // a patch for every segment

Point between(const Point& a, const Point& b, double u);  // a at u = 0, b at u = 1

}  // namespace strata::shapes
