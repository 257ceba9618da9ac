// Triangle soups of known shape for tests. All are closed unless said, normals point out of the solid, patches are named.
#pragma once

#include <cstdint>

#include "core/base/vec3.h"
#include "core/surface/triangle_soup.h"

namespace strata::test {

// Unit cube [0,1]^3, n x n squares (two triangles each) a face. Patches "x_min", "x_max", "y_min", "y_max", "z_min", "z_max".
TriangleSoup cube(int n = 1);
// Axis-aligned box, one patch a side as for the cube.
TriangleSoup box(const Vec3& min, const Vec3& max, int n = 1);
// Icosphere around 0, radius 1, 20 * 4^subdivisions triangles. Patch "sphere".
TriangleSoup sphere(int subdivisions = 3);
// Around the z axis from z = 0 to `height`, radius 1, `segments` around. Patches "side", "cap_bottom", "cap_top".
TriangleSoup cylinder(int segments = 32, double height = 2, int rings = 4);
// Base disc radius 1 at z = 0, apex at z = height. Patches "side", "base".
// The same with its upper edge cut off at 45 degrees; one patch.
TriangleSoup chamfered_cylinder(double chamfer, int segments = 48);
// A unit cube whose one upper half stands higher by `step`; one patch.
TriangleSoup stepped_cube(double step);
TriangleSoup cone(int segments = 32, double height = 2, int rings = 4);
// [0,2]x[0,2]x[0,1] less (1,2]x(1,2]x[0,1], n squares a unit length. Patches "x_min", "y_min", "x_max", "y_max", "notch_x" (the re-entrant
// face x = 1), "notch_y", "z_min", "z_max".
TriangleSoup l_block(int n = 2);
// Around the z axis, radii R (ring) and r (tube). Patch "torus".
TriangleSoup torus(double ring = 1, double tube = 0.35, int around = 48, int across = 24);
// The cube with the face z_max cut in "z_max_left" (x < 1/2) and "z_max_right" by a flat patch border. n even.
TriangleSoup two_patches(int n = 2);
// Prism along y, length 1: triangle cross-section with apex at 0, unit legs, interior angle `angle` (radians) at the apex edge.
// Patches "lower", "upper", "back", "y_min", "y_max". n squares along each leg.
TriangleSoup sharp_wedge(double angle, int n = 2);
// Sphere of radius 0.5 (normals out of the sphere) around the centre of the box [-2,2]^3. Patches "sphere" and the box's six.
TriangleSoup sphere_in_box(int subdivisions = 3, int n = 4);
// Two unit cubes sharing the face x = 1; each closed and outward, the interface is present twice, opposite. Patches "left", "right".
TriangleSoup touching_cubes(int n = 2);

TriangleSoup scaled(TriangleSoup soup, double factor);
TriangleSoup shifted(TriangleSoup soup, const Vec3& by);
TriangleSoup rotated(TriangleSoup soup, const Vec3& axis, double angle);
// Triangles (and corners within them, cyclically) in random order.
TriangleSoup shuffled(TriangleSoup soup, std::uint32_t seed);
// Every point moved by at most `amount` a coordinate.
TriangleSoup jittered(TriangleSoup soup, double amount, std::uint32_t seed);
// Every triangle with its own three points, as STL files have them.
TriangleSoup exploded(const TriangleSoup& soup);
// Every triangle turned round.
TriangleSoup flipped(TriangleSoup soup);
// Both soups; patches of the same name become one.
TriangleSoup joined(TriangleSoup a, const TriangleSoup& b);

}  // namespace strata::test
