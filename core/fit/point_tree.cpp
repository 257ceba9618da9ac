#include "core/fit/point_tree.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

namespace strata {

PointTree::PointTree(const HexMesh& mesh, const std::vector<VertexId>& vertices) {
  entries_.reserve(vertices.size());
  for (VertexId v : vertices) entries_.push_back({mesh.position[v], v});
  build(0, entries_.size(), 0);
}

void PointTree::build(std::size_t begin, std::size_t end, int axis) {
  if (end - begin < 2) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return entries_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [axis](const Entry& a, const Entry& b) {
    return std::tie(a.position[axis], a.vertex) < std::tie(b.position[axis], b.vertex);
  });
  build(begin, middle, (axis + 1) % 3);
  build(middle + 1, end, (axis + 1) % 3);
}

template <class Visit>
void PointTree::visit(std::size_t begin, std::size_t end, int axis, const Vec3& p, double radius, const Visit& found) const {
  if (begin == end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const Entry& entry = entries_[middle];
  const double d = (entry.position - p).norm();
  if (d <= radius) found(d, entry.vertex);
  const double side = p[axis] - entry.position[axis];
  if (side <= radius) visit(begin, middle, (axis + 1) % 3, p, radius, found);
  if (side >= -radius) visit(middle + 1, end, (axis + 1) % 3, p, radius, found);
}

void PointTree::visit_nearest(std::size_t begin, std::size_t end, int axis, const Vec3& p, std::pair<double, VertexId>& best) const {
  if (begin == end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const Entry& entry = entries_[middle];
  best = std::min(best, {(entry.position - p).norm(), entry.vertex});
  const double side = p[axis] - entry.position[axis];
  const int next = (axis + 1) % 3;
  const auto left = [&] {
    if (side <= best.first) visit_nearest(begin, middle, next, p, best);
  };
  const auto right = [&] {
    if (-side <= best.first) visit_nearest(middle + 1, end, next, p, best);
  };
  if (side < 0) {
    left();
    right();
  } else {
    right();
    left();
  }
}

VertexId PointTree::nearest(const Vec3& p) const {
  std::pair<double, VertexId> best(std::numeric_limits<double>::infinity(), VertexId());
  visit_nearest(0, entries_.size(), 0, p, best);
  return best.second;
}

std::vector<VertexId> PointTree::within(const Vec3& p, double radius) const {
  std::vector<std::pair<double, VertexId>> found;
  visit(0, entries_.size(), 0, p, radius, [&](double d, VertexId v) { found.emplace_back(d, v); });
  std::sort(found.begin(), found.end());
  std::vector<VertexId> result;
  result.reserve(found.size());
  for (const auto& [d, v] : found) result.push_back(v);
  return result;
}

}  // namespace strata
