// The example bodies. All are watertight, and every closed shell turns outwards, as STL files use to: a body in a box and the box
// alike. `fineness` multiplies the number of segments along every edge; chord errors fall with its square.
#pragma once

#include <string>
#include <vector>

#include "bench/shapes/patched_surface.h"

namespace strata::shapes {

// Unit cube, one patch a face: xmin, xmax, ymin, ymax, zmin, zmax.
PatchedSurface cube(int fineness);

// Unit-diameter cylinder of length 2 along x: side, front, back.
PatchedSurface cylinder(int fineness);

// Ball of diameter 1 about the origin: sphere.
PatchedSurface sphere(int fineness);

// The flow around a ball of diameter 1 in a box of side 6: sphere, inlet, outlet, farfield.
PatchedSurface sphere_in_box(int fineness);

// The flow around a rocket of length 5.5 and diameter 1 along x, with a blunted ogive nose, four swept fins and an open bell nozzle:
// nose, body, fins, base, nozzle_outer, nozzle_lip, nozzle_inner, nozzle_throat, inlet, outlet, farfield. No solid edge is sharper than
// 90 degrees.
PatchedSurface rocket(int fineness);

struct Shape {
  std::string name;
  PatchedSurface (*make)(int fineness);
};
const std::vector<Shape>& all_shapes();

}  // namespace strata::shapes
