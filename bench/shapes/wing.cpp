// The flow around half an aircraft's wing on its plane of symmetry: tapered and swept, with a sharp trailing edge and a round tip.
//
//      y ^      ____             root: chord 1 at y = 0
//        |     /   /             tip: chord 0.5 at y = 2
//        |    /   /
//        +---/___/----> x
#include "bench/shapes/blade.h"
#include "bench/shapes/planar.h"
#include "bench/shapes/primitives.h"
#include "bench/shapes/shapes.h"

namespace strata::shapes {

PatchedSurface wing(int fineness) {
  constexpr double kThickness = 0.12;
  const Profile root = {{0, 0, 0}, 1, kThickness, {0, 0, 1}};
  const Profile tip = {{0.7, 2, 0}, 0.5, kThickness, {0, 0, 1}};
  PatchedSurface surface;
  const auto stations = chord_stations(24 * fineness);
  const StraightBlade blade(add_section(surface, root, stations), tip, stations);
  blade.add(surface, {0, 1, 0}, 40 * fineness, 4 * fineness, surface.patch("wing"));
  turn_inside_out(surface);  // the wing bounds the flow from inside
  const auto wall =
      add_open_box(surface, {-3, 0, -3.5}, {5, 5, 3.5}, {"inlet", "outlet", "symmetry", "farfield", "farfield", "farfield"}, 8, 2);
  add_planar(surface, wall, {outline_of(blade.root())}, surface.patch("symmetry"));
  return surface;
}

}  // namespace strata::shapes
