#include "bench/shapes/rows.h"

namespace strata::shapes {

Row add_row(PatchedSurface& surface, const std::vector<Point>& points) {
  Row row;
  for (const auto& point : points) row.push_back(surface.add_point(point));
  return row;
}

Row split_row(PatchedSurface& surface, const Row& row, int first, int last, const std::vector<Point>& points) {
  Row other = row;
  for (int i = first + 1; i < last; ++i) other[i] = surface.add_point(points[i]);
  return other;
}

Row part_of(const Row& row, int first, int last) { return {row.begin() + first, row.begin() + last + 1}; }

void add_strip(PatchedSurface& surface, const Row& a, const Row& b, int patch) {
  add_strip(surface, a, b, std::vector<int>(a.size(), patch));
}

void add_strip(PatchedSurface& surface, const Row& a, const Row& b, const std::vector<int>& patches) {
  for (std::size_t i = 0; i + 1 < a.size(); ++i) surface.add_quad(a[i], a[i + 1], b[i + 1], b[i], patches[i]);
}

Point between(const Point& a, const Point& b, double u) {
  return {a[0] + u * (b[0] - a[0]), a[1] + u * (b[1] - a[1]), a[2] + u * (b[2] - a[2])};
}

}  // namespace strata::shapes
