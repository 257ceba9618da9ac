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

// The flow around a jet fighter of length 10 and span 12 along x: body, intake, exhaust, wing, tail, tail_wing, inlet, outlet, farfield.
// The trailing edges of wing, tail and tail wing are sharp (about 16 degrees); the tail wing stands on the tail, the tail on the body.
PatchedSurface fighter(int fineness);

// The water around half a ship's hull of length 6 along x, up to the waterline z = 0, y >= 0: hull, keel, transom, symmetry, free_surface,
// inlet, outlet, side, bottom.
PatchedSurface hull(int fineness);

// The flow around a car's side mirror, about 0.5 wide, on the wall z = 0: housing, rim, glass, foot, plate, wall, inlet, outlet, sides, top.
PatchedSurface mirror(int fineness);

// The flow around a tapered, swept wing of half span 2 and chord 1 to 0.5 on the plane of symmetry y = 0, with a sharp trailing edge (16
// degrees): wing, symmetry, inlet, outlet, farfield.
PatchedSurface wing(int fineness);

// A mechanical part, 4 x 3 x 0.5, with three bores: top, bottom, side, bores.
PatchedSurface bracket(int fineness);

struct Shape {
  std::string name;
  PatchedSurface (*make)(int fineness);
};
const std::vector<Shape>& all_shapes();

}  // namespace strata::shapes
