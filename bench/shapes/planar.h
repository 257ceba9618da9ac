// Flat faces with any outline and any holes.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "bench/shapes/rows.h"

namespace strata::shapes {

// Fills the region inside `outline` and outside `holes` with triangles on the given points alone, as close to Delaunay's as the borders
// allow. The outline is closed (its first point is not repeated) and gives the orientation: counterclockwise seen from where the normal
// points to; the holes may turn either way. All points lie in one plane; the borders neither touch nor cross. Cost is quadratic.
void add_planar(PatchedSurface& surface, const Row& outline, const std::vector<Row>& holes, int patch);

// Straight edges between points, each cut into `segments`; faces that ask for the same edge share its points.
class StraightEdges {
 public:
  StraightEdges(PatchedSurface& surface, int segments) : surface_(surface), segments_(segments) {}

  Row operator()(int from, int to);                // without its last point, so that edges make loops
  Row through(const std::vector<int>& corners);    // the closed loop
 private:
  PatchedSurface& surface_;
  int segments_;
  std::map<std::pair<int, int>, Row> inner_;  // from the lower id to the higher
};

void append(Row& row, const Row& more);
Row reversed(Row row);

}  // namespace strata::shapes
