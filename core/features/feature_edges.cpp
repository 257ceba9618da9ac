#include "core/features/feature_edges.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/base/parallel.h"
#include "core/base/triangle_geometry.h"
#include "core/surface/draft.h"

namespace strata {
namespace {

constexpr double kWeakOfStrong = 0.5;  // hysteresis: weak ridges turn by half of the ridge angle at least
constexpr double kDistinct = 2;        // a weak ridge turns this much more than the edges beside it; tessellated rounds do not
constexpr int kExtension = 3;          // weak edges that extend a strong chain at least
constexpr double kFloatGrain = 1e-7;        // of float coordinates, working frame

// Groups of marked edges connected through points: union-find with the smallest point as root.
class PointGroups {
 public:
  explicit PointGroups(std::size_t points) : root_(points) { std::iota(root_.begin(), root_.end(), 0); }
  void join(PointId a, PointId b) {
    const std::int32_t ra = find(a), rb = find(b);
    root_[static_cast<std::size_t>(std::max(ra, rb))] = std::min(ra, rb);
  }
  std::int32_t find(PointId p) {
    std::int32_t i = p.value;
    while (root_[static_cast<std::size_t>(i)] != i) {
      std::int32_t& up = root_[static_cast<std::size_t>(i)];
      up = root_[static_cast<std::size_t>(up)];
      i = up;
    }
    return i;
  }

 private:
  std::vector<std::int32_t> root_;
};

// An open edge is none: the mesh closes the surface there.
bool is_hard(const Surface& surface, const FeatureEdge& e) {
  return e.count > 2 ||
         (e.count == 2 && (!e.forward.valid() || !e.backward.valid() || surface.patch[e.forward] != surface.patch[e.backward]));
}

// The sharpest turn beside the edge: over the sides of its two triangles and of the triangles next to them, but for ridges
// and for edges that go on in the same direction.
double turn_beside(const Surface& surface, const std::vector<std::array<std::int32_t, 3>>& edge_of_side,
                   const std::vector<FeatureEdge>& edges, std::size_t edge, const std::vector<EdgeMark>& mark) {
  const FeatureEdge& e = edges[edge];
  const Vec3 along = (surface.points[e.high] - surface.points[e.low]) / e.length;
  constexpr double kSameDirection = 0.87;  // cosine of 30 degrees
  double sharpest = 0;
  const auto look = [&](TriangleId t) {
    for (const std::int32_t side : edge_of_side[t.index()]) {
      const auto i = static_cast<std::size_t>(side);
      const FeatureEdge& other = edges[i];
      if (i == edge || mark[i] != EdgeMark::Plain) continue;
      const bool touches = other.low == e.low || other.low == e.high || other.high == e.low || other.high == e.high;
      const Vec3 direction = (surface.points[other.high] - surface.points[other.low]) / other.length;
      if (touches && std::abs(direction.dot(along)) > kSameDirection) continue;
      sharpest = std::max(sharpest, std::abs(other.turn) - other.doubt);
    }
  };
  for (const TriangleId t : {e.forward, e.backward}) {
    look(t);
    for (const TriangleId n : surface.neighbours[t])
      if (n.valid()) look(n);
  }
  return sharpest;
}

void extend_by_weak(const Surface& surface, const std::vector<FeatureEdge>& edges, double ridge_angle, std::vector<EdgeMark>& mark) {
  std::vector<std::array<std::int32_t, 3>> edge_of_side;
  std::vector<char> weak(edges.size(), 0);
  bool any = false;
  for (std::size_t i = 0; i < edges.size(); ++i)
    any |= weak[i] = mark[i] == EdgeMark::Plain && std::abs(edges[i].turn) - edges[i].doubt > kWeakOfStrong * ridge_angle;
  if (!any) return;
  edge_of_side.resize(surface.triangles.size());
  parallel_for(surface.triangles.size(), [&](std::size_t t) {
    const TrianglePoints& p = surface.triangles[TriangleId(t)];
    for (std::size_t s = 0; s < 3; ++s) {
      const auto [low, high] = std::minmax({p[s], p[(s + 1) % 3]});
      const auto at = std::lower_bound(edges.begin(), edges.end(), std::pair(low, high),
                                       [](const FeatureEdge& e, const auto& key) { return std::pair(e.low, e.high) < key; });
      edge_of_side[t][s] = static_cast<std::int32_t>(at - edges.begin());
    }
  });
  const std::vector<char> candidates = weak;
  parallel_for(edges.size(), [&](std::size_t i) {
    if (candidates[i]) weak[i] = std::abs(edges[i].turn) > kDistinct * turn_beside(surface, edge_of_side, edges, i, mark);
  });

  // Groups of weak edges: kept with enough edges at one strong point, or when they join two.
  std::vector<char> strong_point(surface.points.size(), 0);
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (mark[i] == EdgeMark::Feature) strong_point[edges[i].low.index()] = strong_point[edges[i].high.index()] = 1;
  PointGroups groups(surface.points.size());
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (weak[i]) groups.join(edges[i].low, edges[i].high);
  std::vector<std::int32_t> edge_count(surface.points.size(), 0), contacts(surface.points.size(), 0);
  std::vector<char> counted(surface.points.size(), 0);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (!weak[i]) continue;
    const auto root = static_cast<std::size_t>(groups.find(edges[i].low));
    ++edge_count[root];
    for (const PointId p : {edges[i].low, edges[i].high}) {
      if (!strong_point[p.index()] || counted[p.index()]) continue;
      counted[p.index()] = 1;
      ++contacts[root];
    }
  }
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (!weak[i]) continue;
    const auto root = static_cast<std::size_t>(groups.find(edges[i].low));
    if (contacts[root] >= 2 || (contacts[root] == 1 && edge_count[root] >= kExtension)) mark[i] = EdgeMark::Feature;
  }
}

}  // namespace

std::vector<FeatureEdge> all_edges(const Surface& surface) {
  std::vector<std::array<std::int32_t, 3>> triangles(surface.triangles.size());
  parallel_for(triangles.size(), [&](std::size_t t) {
    for (std::size_t i = 0; i < 3; ++i) triangles[t][i] = surface.triangles[TriangleId(t)][i].value;
  });
  const std::vector<Side> sides = sorted_sides(triangles);
  std::vector<FeatureEdge> edges;
  edges.reserve(sides.size() / 2);
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    FeatureEdge e;
    e.low = PointId(sides[first].low);
    e.high = PointId(sides[first].high);
    e.count = static_cast<std::int32_t>(last - first);
    for (std::size_t i = first; i < last; ++i) {
      const TriangleId t(sides[i].triangle);
      TriangleId& on = surface.triangles[t][static_cast<std::size_t>(sides[i].side)] == e.low ? e.forward : e.backward;
      if (!on.valid()) on = t;
    }
    edges.push_back(e);
  });
  parallel_for(edges.size(), [&](std::size_t i) {
    FeatureEdge& e = edges[i];
    const Vec3 along = surface.points[e.high] - surface.points[e.low];
    e.length = along.norm();
    if (e.count != 2 || !e.forward.valid() || !e.backward.valid()) return;
    const Vec3 &n0 = surface.normal[e.forward], &n1 = surface.normal[e.backward];
    e.turn = std::atan2(n0.cross(n1).dot(along) / e.length, n0.dot(n1));
    for (const TriangleId t : {e.forward, e.backward}) {
      const auto [a, b, c] = surface.corners(t);
      e.doubt += kFloatGrain / smallest_altitude(a, b, c);
    }
  });
  return edges;
}

std::vector<EdgeMark> mark_features(const Surface& surface, const std::vector<FeatureEdge>& edges, const FeatureOptions& options) {
  std::vector<EdgeMark> mark(edges.size(), EdgeMark::Plain);
  parallel_for(edges.size(), [&](std::size_t i) {
    const double turn = std::abs(edges[i].turn) - edges[i].doubt;
    if (is_hard(surface, edges[i])) mark[i] = EdgeMark::Feature;
    else if (options.round_sharp && turn > std::numbers::pi - kSharpRidge) mark[i] = EdgeMark::Rounded;
    else if (turn > options.ridge_angle) mark[i] = EdgeMark::Feature;
  });
  extend_by_weak(surface, edges, options.ridge_angle, mark);
  return mark;
}

}  // namespace strata
