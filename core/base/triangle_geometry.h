// Closed formulas on one triangle.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/base/vec3.h"

namespace strata {

// The point of triangle abc nearest to p. Degenerate triangles give the nearest point of an edge.
// Voronoi regions of the corners, edges and face: Ericson, "Real-time collision detection", 2005, section 5.1.5.
inline Vec3 closest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vec3 bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 / (d1 - d3));
  const Vec3 cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  const double sum = va + vb + vc;
  return a + ab * (vb / sum) + ac * (vc / sum);
}

// Signed solid angle of triangle abc seen from p; positive when the normal points away from p.
// Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 1983.
inline double solid_angle(const Vec3& p, const Vec3& pa, const Vec3& pb, const Vec3& pc) {
  const Vec3 a = pa - p, b = pb - p, c = pc - p;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double above = a.dot(b.cross(c));
  const double below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  if (above == 0) return 0;  // in the plane: undefined inside the triangle, zero outside
  return 2 * std::atan2(above, below);
}

// Twice the area over the longest edge.
inline double smallest_altitude(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double longest = std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
  return longest > 0 ? (b - a).cross(c - a).norm() / longest : 0;
}

}  // namespace strata
