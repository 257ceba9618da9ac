// Holes are joined to the outline by bridges, the polygon this makes is cut into ears, and edges are flipped until the triangulation is
// Delaunay's, which also mends the flat ears that straight borders give.
#include "bench/shapes/planar.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace strata::shapes {

namespace {

using Flat = std::array<double, 2>;
using Triangle = std::array<int, 3>;
using Edge = std::pair<int, int>;

// Twice the area of a triangle, positive when it turns counterclockwise.
double turn(const Flat& a, const Flat& b, const Flat& c) { return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]); }

// Coordinates in a plane in which the outline turns counterclockwise.
class Plane {
 public:
  Plane(const PatchedSurface& surface, const Row& outline) : surface_(surface) {
    std::array<double, 3> area{};  // Newell's normal
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const auto& a = surface.points[outline[i]];
      const auto& b = surface.points[outline[(i + 1) % outline.size()]];
      for (int d = 0; d < 3; ++d) area[d] += (a[(d + 1) % 3] - b[(d + 1) % 3]) * (a[(d + 2) % 3] + b[(d + 2) % 3]);
    }
    for (int d = 1; d < 3; ++d) {
      if (std::abs(area[d]) > std::abs(area[axis_])) axis_ = d;
    }
    u_ = (axis_ + 1) % 3, v_ = (axis_ + 2) % 3;
    if (area[axis_] < 0) std::swap(u_, v_);
  }

  Flat operator()(int id) const { return {surface_.points[id][u_], surface_.points[id][v_]}; }

 private:
  const PatchedSurface& surface_;
  int axis_ = 0, u_ = 1, v_ = 2;
};

double signed_area(const Plane& at, const Row& loop) {
  double twice = 0;
  for (std::size_t i = 1; i + 1 < loop.size(); ++i) twice += turn(at(loop[0]), at(loop[i]), at(loop[i + 1]));
  return twice / 2;
}

bool cross(const Flat& a, const Flat& b, const Flat& c, const Flat& d) {
  return turn(a, b, c) * turn(a, b, d) <= 0 && turn(c, d, a) * turn(c, d, b) <= 0;
}

// Whether the segment between two points touches no border but at its own ends.
bool sees(const Plane& at, int from, int to, const std::vector<Row>& borders) {
  for (const auto& border : borders) {
    for (std::size_t i = 0; i < border.size(); ++i) {
      const int a = border[i], b = border[(i + 1) % border.size()];
      if (a == from || b == from || a == to || b == to) continue;
      if (cross(at(from), at(to), at(a), at(b))) return false;
    }
  }
  return true;
}

struct Bridge {
  double length;
  std::size_t in_polygon, in_hole;
};

std::optional<Bridge> shortest_bridge(const Plane& at, const Row& polygon, const Row& hole, const std::vector<Row>& borders) {
  std::vector<Bridge> bridges;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    for (std::size_t j = 0; j < hole.size(); ++j) {
      const auto a = at(polygon[i]), b = at(hole[j]);
      bridges.push_back({std::hypot(a[0] - b[0], a[1] - b[1]), i, j});
    }
  }
  std::sort(bridges.begin(), bridges.end(), [](const Bridge& a, const Bridge& b) {
    return std::tie(a.length, a.in_polygon, a.in_hole) < std::tie(b.length, b.in_polygon, b.in_hole);
  });
  for (const auto& bridge : bridges) {
    if (sees(at, polygon[bridge.in_polygon], hole[bridge.in_hole], borders)) return bridge;
  }
  return std::nullopt;
}

// One polygon, walking every bridge twice. The hole nearest to the polygon is joined first, so that no bridge needs to pass another hole.
Row join_holes(const Plane& at, Row polygon, std::vector<Row> holes) {
  for (auto& hole : holes) {
    if (signed_area(at, hole) > 0) std::reverse(hole.begin(), hole.end());
  }
  while (!holes.empty()) {
    auto borders = holes;
    borders.push_back(polygon);
    std::optional<Bridge> best;
    std::size_t nearest = 0;
    for (std::size_t h = 0; h < holes.size(); ++h) {
      const auto bridge = shortest_bridge(at, polygon, holes[h], borders);
      if (bridge && (!best || bridge->length < best->length)) best = bridge, nearest = h;
    }
    if (!best) throw std::logic_error("a hole of a flat face lies outside of its outline or touches it");
    Row walk = holes[nearest];
    std::rotate(walk.begin(), walk.begin() + static_cast<std::ptrdiff_t>(best->in_hole), walk.end());
    walk.push_back(walk.front());
    walk.push_back(polygon[best->in_polygon]);
    polygon.insert(polygon.begin() + static_cast<std::ptrdiff_t>(best->in_polygon) + 1, walk.begin(), walk.end());
    holes.erase(holes.begin() + static_cast<std::ptrdiff_t>(nearest));
  }
  return polygon;
}

bool is_ear(const Plane& at, const Row& polygon, std::size_t i) {
  const std::size_t n = polygon.size();
  const int ia = polygon[(i + n - 1) % n], ib = polygon[i], ic = polygon[(i + 1) % n];
  const auto a = at(ia), b = at(ib), c = at(ic);
  if (turn(a, b, c) <= 0) return false;
  for (const int id : polygon) {
    if (id == ia || id == ib || id == ic) continue;
    const auto p = at(id);
    if (turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) return false;
  }
  return true;
}

std::vector<Triangle> cut_ears(const Plane& at, Row polygon) {
  std::vector<Triangle> triangles;
  std::size_t i = 0, misses = 0;
  while (polygon.size() > 3) {
    const std::size_t n = polygon.size();
    i %= n;
    if (is_ear(at, polygon, i)) {
      triangles.push_back({polygon[(i + n - 1) % n], polygon[i], polygon[(i + 1) % n]});
      polygon.erase(polygon.begin() + static_cast<std::ptrdiff_t>(i));
      misses = 0;
    } else if (++misses > n) {
      throw std::logic_error("the borders of a flat face cross or touch");
    }
    ++i;  // every other corner, so that ears do not become a fan
  }
  triangles.push_back({polygon[0], polygon[1], polygon[2]});
  return triangles;
}

double angle_at(const Plane& at, int apex, int from, int to) {
  const auto p = at(apex), a = at(from), b = at(to);
  const double dot = (a[0] - p[0]) * (b[0] - p[0]) + (a[1] - p[1]) * (b[1] - p[1]);
  return std::atan2(std::abs(turn(p, a, b)), dot);
}

int apex_of(const Triangle& t, int a, int b) {
  for (const int p : t) {
    if (p != a && p != b) return p;
  }
  return -1;
}

// Flips the edge between two triangles when that is Delaunay's choice: the angles opposite to it make more than half a turn.
bool flip(const Plane& at, Triangle& first, Triangle& second, int a, int b) {
  constexpr double kHair = 1e-9;  // radians: squares may keep either diagonal, and flipping must come to an end
  const int c = apex_of(first, a, b), d = apex_of(second, a, b);
  if (angle_at(at, c, a, b) + angle_at(at, d, a, b) <= std::numbers::pi + kHair) return false;
  first = {c, a, d};
  second = {d, b, c};
  for (Triangle* t : {&first, &second}) {
    if (turn(at((*t)[0]), at((*t)[1]), at((*t)[2])) < 0) std::swap((*t)[1], (*t)[2]);
  }
  return true;
}

// Sweeps over all edges, each time leaving alone what this sweep has changed already, until nothing changes.
void make_delaunay(const Plane& at, std::vector<Triangle>& triangles) {
  for (bool changed = true; changed;) {
    changed = false;
    std::map<Edge, std::array<int, 2>> sides;
    for (int t = 0; t < static_cast<int>(triangles.size()); ++t) {
      for (int i = 0; i < 3; ++i) {
        const auto [side, inserted] = sides.try_emplace(std::minmax(triangles[t][i], triangles[t][(i + 1) % 3]), std::array{t, -1});
        if (!inserted) side->second[1] = t;
      }
    }
    std::vector<char> touched(triangles.size());
    for (const auto& [edge, side] : sides) {
      if (side[1] < 0 || touched[side[0]] || touched[side[1]]) continue;
      if (!flip(at, triangles[side[0]], triangles[side[1]], edge.first, edge.second)) continue;
      touched[side[0]] = touched[side[1]] = 1;
      changed = true;
    }
  }
}

}  // namespace

void add_planar(PatchedSurface& surface, const Row& outline, const std::vector<Row>& holes, int patch) {
  const Plane at(surface, outline);
  auto triangles = cut_ears(at, join_holes(at, outline, holes));
  make_delaunay(at, triangles);
  for (const auto& t : triangles) surface.add_triangle(t[0], t[1], t[2], patch);
}

Row StraightEdges::operator()(int from, int to) {
  const auto [low, high] = std::minmax(from, to);
  const auto [found, inserted] = inner_.try_emplace({low, high});
  for (int i = 1; inserted && i < segments_; ++i) {
    const double u = static_cast<double>(i) / segments_;
    found->second.push_back(surface_.add_point(between(surface_.points[low], surface_.points[high], u)));
  }
  Row edge = {from};
  append(edge, from == low ? found->second : reversed(found->second));
  return edge;
}

Row StraightEdges::through(const std::vector<int>& corners) {
  Row loop;
  for (std::size_t i = 0; i < corners.size(); ++i) append(loop, (*this)(corners[i], corners[(i + 1) % corners.size()]));
  return loop;
}

void append(Row& row, const Row& more) { row.insert(row.end(), more.begin(), more.end()); }

Row reversed(Row row) {
  std::reverse(row.begin(), row.end());
  return row;
}

}  // namespace strata::shapes
