#include "tests/shapes/crossings.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace strata::shapes {

namespace {

using Triangle = std::array<int, 3>;
using Wide = long double;

// Six times the volume of a tetrahedron.
Wide volume(const Point& a, const Point& b, const Point& c, const Point& d) {
  Wide u[3], v[3], w[3];
  for (int i = 0; i < 3; ++i) u[i] = Wide(b[i]) - a[i], v[i] = Wide(c[i]) - a[i], w[i] = Wide(d[i]) - a[i];
  return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

// Flat quads are flat to rounding only: a point counts as off a plane from this volume on, in cubes of the edges concerned.
constexpr Wide kFlat = 1e-12L;
bool opposite(Wide a, Wide b, Wide flat) { return (a < -flat && b > flat) || (a > flat && b < -flat); }
Wide distance(const Point& a, const Point& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }
bool alike(Wide a, Wide b, Wide c) { return (a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0); }

// Whether the segment passes through the triangle's plane inside the triangle, its border included.
bool pierces(const Point& p, const Point& q, const Point& a, const Point& b, const Point& c) {
  const Wide edges = distance(p, q) + distance(a, b) + distance(b, c);
  if (!opposite(volume(a, b, c, p), volume(a, b, c, q), kFlat * edges * edges * edges)) return false;
  return alike(volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a));
}

bool has(const Triangle& t, int p) { return t[0] == p || t[1] == p || t[2] == p; }

int shared_points(const Triangle& s, const Triangle& t) {
  return static_cast<int>(std::count_if(s.begin(), s.end(), [&](int p) { return has(t, p); }));
}

class Surface {
 public:
  explicit Surface(const PatchedSurface& surface) : s_(surface) {}

  [[nodiscard]] bool cross(int first, int second) const {
    const auto& s = s_.triangles[first];
    const auto& t = s_.triangles[second];
    if (shared_points(s, t) >= 2) return folded(s, t);
    return edge_pierces(s, t) || edge_pierces(t, s);
  }

  void bounds(int triangle, Point& low, Point& high) const {
    low = high = s_.points[s_.triangles[triangle][0]];
    for (const int p : s_.triangles[triangle]) {
      for (int d = 0; d < 3; ++d) low[d] = std::min(low[d], s_.points[p][d]), high[d] = std::max(high[d], s_.points[p][d]);
    }
  }

 private:
  // Edges that begin at a shared point touch there by right.
  [[nodiscard]] bool edge_pierces(const Triangle& s, const Triangle& t) const {
    for (int i = 0; i < 3; ++i) {
      const int p = s[i], q = s[(i + 1) % 3];
      if (has(t, p) || has(t, q)) continue;
      if (pierces(s_.points[p], s_.points[q], s_.points[t[0]], s_.points[t[1]], s_.points[t[2]])) return true;
    }
    return false;
  }

  // Less than a thousandth of a degree between two triangles at their shared edge.
  [[nodiscard]] bool folded(const Triangle& s, const Triangle& t) const {
    Point n = normal(s), m = normal(t);
    double dot = 0;
    for (int d = 0; d < 3; ++d) dot += n[d] * m[d];
    return dot < -1 + 1.5e-10;
  }

  [[nodiscard]] Point normal(const Triangle& t) const {
    Point u, v;
    for (int d = 0; d < 3; ++d) u[d] = s_.points[t[1]][d] - s_.points[t[0]][d], v[d] = s_.points[t[2]][d] - s_.points[t[0]][d];
    Point n = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    const double length = std::hypot(n[0], n[1], n[2]);
    for (double& value : n) value /= length;
    return n;
  }

  const PatchedSurface& s_;
};

}  // namespace

std::vector<std::pair<int, int>> crossings(const PatchedSurface& patched) {
  const Surface surface(patched);
  const int count = static_cast<int>(patched.triangles.size());
  std::vector<Point> low(count), high(count);
  std::vector<int> order;
  for (int t = 0; t < count; ++t) {
    surface.bounds(t, low[t], high[t]);
    order.push_back(t);
  }
  // Sweep along x: triangles whose boxes still reach the next one's stay active.
  std::sort(order.begin(), order.end(), [&](int a, int b) { return low[a][0] < low[b][0]; });
  std::vector<std::pair<int, int>> found;
  std::vector<int> active;
  for (const int t : order) {
    std::erase_if(active, [&](int a) { return high[a][0] < low[t][0]; });
    for (const int a : active) {
      const bool apart = low[a][1] > high[t][1] || high[a][1] < low[t][1] || low[a][2] > high[t][2] || high[a][2] < low[t][2];
      if (!apart && surface.cross(a, t)) found.emplace_back(std::minmax(a, t));
    }
    active.push_back(t);
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace strata::shapes
