// A mechanical part: an L-shaped bracket with three bores, its foot's corners sharp.
#include <cmath>
#include <numbers>

#include "bench/shapes/planar.h"
#include "bench/shapes/shapes.h"

namespace strata::shapes {

namespace {

constexpr double kThickness = 0.5;
const std::vector<std::array<double, 2>> kCorners = {{0, 0}, {4, 0}, {4, 1.2}, {1.2, 1.2}, {1.2, 3}, {0, 3}};
struct Bore {
  double x, y, radius;
};
constexpr Bore kBores[] = {{0.6, 2.4, 0.3}, {3.4, 0.6, 0.3}, {0.7, 0.7, 0.4}};

// A closed loop at the bottom, counterclockwise seen from above, and the wall from it to the top. Returns the loops at bottom and top.
std::pair<Row, Row> add_wall(PatchedSurface& surface, const Row& bottom, int segments, int patch) {
  Row last = bottom;
  for (int k = 1; k <= segments; ++k) {
    Row next;
    for (const int p : bottom) {
      const Point place = surface.points[p];
      next.push_back(surface.add_point({place[0], place[1], kThickness * k / segments}));
    }
    Row from = last, to = next;
    from.push_back(from.front()), to.push_back(to.front());
    add_strip(surface, from, to, patch);
    last = std::move(next);
  }
  return {bottom, last};
}

}  // namespace

PatchedSurface bracket(int fineness) {
  PatchedSurface surface;
  std::vector<int> corners;
  for (const auto& c : kCorners) corners.push_back(surface.add_point({c[0], c[1], 0}));
  const auto outside = add_wall(surface, StraightEdges(surface, 8 * fineness).through(corners), 2 * fineness, surface.patch("side"));
  std::vector<Row> below, above;
  for (const auto& bore : kBores) {
    Row loop;  // clockwise, so that the wall turns into the bore
    const int count = 24 * fineness;
    for (int i = 0; i < count; ++i) {
      const double angle = -2 * std::numbers::pi * i / count;
      loop.push_back(surface.add_point({bore.x + bore.radius * std::cos(angle), bore.y + bore.radius * std::sin(angle), 0}));
    }
    const auto wall = add_wall(surface, loop, 2 * fineness, surface.patch("bores"));
    below.push_back(wall.first), above.push_back(wall.second);
  }
  add_planar(surface, reversed(outside.first), below, surface.patch("bottom"));
  add_planar(surface, outside.second, above, surface.patch("top"));
  return surface;
}

}  // namespace strata::shapes
