// T-junctions: border points that lie on an open edge of another triangle.
#include <algorithm>
#include <cmath>

#include "core/surface/draft.h"

namespace strata {
namespace {

constexpr int kPasses = 4;  // a triangle is split along one of its sides a pass

struct Hanging {
  double s;  // along the edge, 0..1
  std::int32_t point;
  auto operator<=>(const Hanging&) const = default;
};

// Border points, found by box: a balanced tree in an array (left half, middle, right half), split along x, y, z in turn.
class PointTree {
 public:
  PointTree(const Draft& draft, std::vector<std::int32_t> points) : draft_(draft), points_(std::move(points)) {
    build(0, points_.size(), 0);
  }

  template <class Body>
  void visit(const Box& box, const Body& body) const {
    visit(box, body, 0, points_.size(), 0);
  }

 private:
  [[nodiscard]] const Vec3& at(std::int32_t p) const { return draft_.points[static_cast<std::size_t>(p)]; }

  void build(std::size_t first, std::size_t last, int axis) {
    if (last - first < 2) return;
    const std::size_t middle = first + (last - first) / 2;
    std::nth_element(points_.begin() + static_cast<std::ptrdiff_t>(first), points_.begin() + static_cast<std::ptrdiff_t>(middle),
                     points_.begin() + static_cast<std::ptrdiff_t>(last),
                     [&](std::int32_t a, std::int32_t b) { return std::pair(at(a)[axis], a) < std::pair(at(b)[axis], b); });
    build(first, middle, (axis + 1) % 3);
    build(middle + 1, last, (axis + 1) % 3);
  }

  template <class Body>
  void visit(const Box& box, const Body& body, std::size_t first, std::size_t last, int axis) const {
    if (first == last) return;
    const std::size_t middle = first + (last - first) / 2;
    const Vec3& p = at(points_[middle]);
    if (box.min[axis] <= p[axis]) visit(box, body, first, middle, (axis + 1) % 3);
    if ((p.array() >= box.min.array()).all() && (p.array() <= box.max.array()).all()) body(points_[middle]);
    if (p[axis] <= box.max[axis]) visit(box, body, middle + 1, last, (axis + 1) % 3);
  }

  const Draft& draft_;
  std::vector<std::int32_t> points_;
};

}  // namespace

Repair split_at_hanging_points(Draft& draft) {
  Repair repair;
  for (int pass = 0; pass < kPasses; ++pass) {
    const std::vector<OpenEdge> open = open_edges(draft);
    if (open.empty()) break;
    std::vector<std::int32_t> border;
    for (const OpenEdge& e : open) border.insert(border.end(), {e.from, e.to});
    std::sort(border.begin(), border.end());
    border.erase(std::unique(border.begin(), border.end()), border.end());
    const PointTree tree(draft, border);
    std::vector<char> kept(draft.size(), 1);
    bool changed = false;
    for (const OpenEdge& e : open) {
      const auto t = static_cast<std::size_t>(e.triangle);
      if (!kept[t]) continue;  // already split along another side in this pass
      const std::int32_t apex = draft.triangles[t][static_cast<std::size_t>((e.side + 2) % 3)];
      const Vec3 a = draft.points[static_cast<std::size_t>(e.from)];
      const Vec3 along = draft.points[static_cast<std::size_t>(e.to)] - a;
      const double length2 = along.squaredNorm();
      Box box;
      box.add(a);
      box.add(Vec3(a + along));
      box.min.array() -= kWeldDistance;
      box.max.array() += kWeldDistance;
      std::vector<Hanging> hanging;
      tree.visit(box, [&](std::int32_t p) {
        if (p == e.from || p == e.to || p == apex) return;
        const Vec3 d = draft.points[static_cast<std::size_t>(p)] - a;
        const double s = d.dot(along) / length2;
        if (s > 0 && s < 1 && (d - s * along).squaredNorm() <= kWeldDistance * kWeldDistance) hanging.push_back({s, p});
      });
      if (hanging.empty()) continue;
      std::sort(hanging.begin(), hanging.end());
      note(repair, draft, t);
      changed = true;
      kept[t] = 0;
      std::int32_t from = e.from;
      hanging.push_back({1, e.to});
      for (const Hanging& h : hanging) {
        draft.triangles.push_back({apex, from, h.point});
        draft.patch.push_back(draft.patch[t]);
        draft.source.push_back(draft.source[t]);
        kept.push_back(1);
        from = h.point;
      }
    }
    draft.keep(kept);
    if (!changed) break;
  }
  return repair;
}

}  // namespace strata
