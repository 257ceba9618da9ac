// The surface while it is being conditioned, and the repairs on it. Working frame, plain indices.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/diagnostic.h"
#include "core/base/vec3.h"
#include "core/surface/surface.h"

namespace strata {

// Lengths are fractions of the longest side of the bounding box; the working frame makes that side about 1.
// Border vertices nearer than this are one: float files and their converters leave gaps of 1e-7 to 3e-6.
inline constexpr double kWeldDistance = 5e-6;
// ... but never further than this part of the shortest edge there, so that fine detail does not collapse.
inline constexpr double kWeldOfEdge = 0.25;
// A triangle is flat when an altitude is below the grain of float coordinates and below this part of its longest edge,
inline constexpr double kFlatDistance = 2e-7;
inline constexpr double kFlatOfEdge = 1e-3;
// ... or below what doubles can tell apart.
inline constexpr double kNothing = 1e-13;

struct Draft {
  std::vector<Vec3> points;
  std::vector<std::array<std::int32_t, 3>> triangles;
  std::vector<std::int32_t> patch;
  std::vector<std::int64_t> source;  // index as read
  Frame frame;

  [[nodiscard]] std::size_t size() const { return triangles.size(); }
  void keep(const std::vector<char>& kept);                  // drops the triangles with kept[t] == 0, keeping the order
  void replace_points(const std::vector<std::int32_t>& by);  // corner p becomes by[p]
};

// One side of a triangle. Sorted by (low, high, triangle, side): the sides of one edge are neighbours in the table.
struct Side {
  std::int32_t low, high;  // points
  std::int32_t triangle;
  std::int32_t side;       // from corner `side` to corner `side + 1`
  friend auto operator<=>(const Side&, const Side&) = default;
};
std::vector<Side> sorted_sides(const std::vector<std::array<std::int32_t, 3>>& triangles);
// Calls body(first, last) for every run of sides of one edge.
template <class Body>
void for_each_edge(const std::vector<Side>& sides, const Body& body) {
  for (std::size_t first = 0, last; first < sides.size(); first = last) {
    for (last = first + 1; last < sides.size() && sides[last].low == sides[first].low && sides[last].high == sides[first].high;) ++last;
    body(first, last);
  }
}
// Open edges, as (from, to) in the direction of their triangle.
struct OpenEdge {
  std::int32_t from, to, triangle, side;
};
std::vector<OpenEdge> open_edges(const Draft& draft);

// What a repair did, to be reported.
struct Repair {
  std::vector<std::int64_t> triangles;  // sources, not yet limited to kMaxListed
  Box box;                              // working frame
  std::int64_t count = 0;
};
void note(Repair& repair, const Draft& draft, std::size_t triangle);

// Points with equal coordinates become one.
std::int64_t weld_equal(Draft& draft);
// Border points within kWeldDistance become one. Returns how many vanished.
std::int64_t weld_borders(Draft& draft);
// Needles (two corners nearly in one place) lose their short edge; triangles with a repeated corner vanish.
Repair collapse_needles(Draft& draft);
// Drops flat triangles whose corners are all apart: what they leave open is closed by split_at_hanging_points.
Repair drop_flat(Draft& draft);
// Splits the triangles along open edges that pass through border points.
Repair split_at_hanging_points(Draft& draft);
struct Duplicates {
  Repair same, opposite;
};
// Of several triangles on the same three points the first stays.
Duplicates drop_duplicates(Draft& draft);
// Openings of a shell, flat or a little bent and up to an eighth of its area, are closed where that parts inside from outside (by the winding
// number); flat borders inside a flat one that run the other way are left out of its cap. Needs consistent orientation. Triangles of caps have
// the patch of most of their border. Counts caps, lists the triangles round them.
Repair cap_openings(Draft& draft);
// Components that are open sheets, when there is also a closed one.
Repair drop_sheets(Draft& draft);
// Makes the orientation agree across manifold edges; outwards (positive volume) per closed piece. Returns what was turned.
Repair orient(Draft& draft);
// Fills neighbours, components and closed from the triangles.
void connect(Surface& surface);
// Connected through shared edges; numbered in order of the first triangle.
std::vector<std::int32_t> components(const std::vector<std::array<std::int32_t, 3>>& triangles, const std::vector<Side>& sides);

}  // namespace strata
