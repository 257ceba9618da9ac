#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/fit/matching.h"

namespace strata {
namespace {

constexpr double kReach = 2.0;        // a corner's vertex is sought within so many local edge lengths
constexpr double kFarReach = 6.0;     // where there is none: the cells end so far short of the tip of a spike
constexpr double kSpareWeight = 0.15; // an edge that no route needs, against an edge length of distance
constexpr double kMissingWeight = 1;  // a route without an edge of its own
constexpr double kTurnWeight = 0.25;  // mean square of the angle between routes and their edges
constexpr double kSectorWeight =
    0.3; // square of the quads that a sector between routes has too many or too few: it wants one for 90 degrees

constexpr double kMostForAngles = 1.5; // edge lengths that a vertex with better edges may lie farther away
constexpr double kNearerToOther = 1;   // for a vertex that lies nearer to another corner

struct End {
  double angle;
  std::int32_t route;
  std::size_t which;  // 0 starts here, 1 ends here
  Vec3 direction;
  ChartId left, right;  // beside the curve, seen along the direction
  double quads_after = 0;  // wanted in the sector from here to the next end, counter-clockwise; 0: not known
};

Vec3 skin_normal(const Matching& m, VertexId v) {
  Vec3 normal = Vec3::Zero();
  for (std::int32_t e : m.skin.edges_round(v))
    for (QuadId q : m.skin.quads_of(m.skin.edges()[static_cast<std::size_t>(e)])) {
      const QuadVertices& c = m.mesh.quads[q];
      normal += (m.mesh.position[c[2]] - m.mesh.position[c[0]]).cross(m.mesh.position[c[3]] - m.mesh.position[c[1]]);
    }
  return normal.norm() > 0 ? Vec3(normal.normalized()) : Vec3::UnitZ();
}

// From an end of the route to the place `reach` along it.
Vec3 departure(const Route& route, std::size_t which, double reach) {
  const auto n = route.points.size();
  const auto at = [&](std::size_t i) -> const Vec3& { return route.points[which == 1 ? n - 1 - i : i]; };
  for (std::size_t i = 1; i < n; ++i)
    if ((at(i) - at(0)).norm() >= reach || i + 1 == n) return at(i) - at(0);
  return Vec3::Zero();
}

struct Assignment {
  double cost = std::numeric_limits<double>::infinity();
  std::vector<std::int32_t> choice;  // per route end: index of the edge
};

// The injective assignment of route ends to edges, both by rising angle, that keeps the cyclic order, turns least and leaves each sector the
// quads its angle wants.
Assignment assign_in_order(const std::vector<End>& ends, const std::vector<std::pair<double, std::int32_t>>& edges) {
  const auto k = static_cast<int>(ends.size()), n = static_cast<int>(edges.size());
  Assignment best;
  std::vector<std::int32_t> chosen(ends.size(), -1);
  const auto turn = [&](int i, int e) {
    const double d = std::remainder(ends[static_cast<std::size_t>(i)].angle - edges[static_cast<std::size_t>(e)].first, 2 * M_PI);
    return kTurnWeight * d * d / k;
  };
  const auto sector = [&](int i, int from, int to) {
    const double wanted = ends[static_cast<std::size_t>(i)].quads_after;
    const int quads = k == 1 ? n : (to - from + n) % n;
    return wanted > 0 ? kSectorWeight * (quads - wanted) * (quads - wanted) : 0;
  };
  const auto extend = [&](auto&& self, int end, int first, int from, double cost) -> void {
    if (end == k) cost += sector(k - 1, chosen[static_cast<std::size_t>(k - 1)], first);
    if (cost >= best.cost) return;
    if (end == k) {
      best.cost = cost;
      best.choice = chosen;
      return;
    }
    for (int step = from; step <= n - (k - end); ++step) {
      const int e = (first + step) % n;
      chosen[static_cast<std::size_t>(end)] = e;
      self(self, end + 1, first, step + 1, cost + turn(end, e) + sector(end - 1, chosen[static_cast<std::size_t>(end - 1)], e));
    }
  };
  for (int first = 0; first < n; ++first) {
    chosen[0] = first;
    extend(extend, 1, first, 1, turn(0, first));
  }
  return best;
}

class CornerMatcher {
 public:
  explicit CornerMatcher(Matching& m) : m_(m), ends_(m.plan.stands_for.size()) {
    for (std::size_t r = 0; r < m.plan.routes.size(); ++r) {
      const Route& route = m.plan.routes[r];
      const double reach = std::min(route.size, 0.5 * route.length);
      for (const std::size_t which : {0, 1}) {
        const CornerId at = which == 0 ? route.first : route.last;
        if (!at.valid()) continue;
        const auto [left, right] = beside(route, which);
        ends_[at].push_back({0, static_cast<std::int32_t>(r), which, departure(route, which, reach), left, right});
      }
    }
  }

  // Busy corners choose first.
  void run() {
    std::vector<CornerId> order;
    for (CornerId c : ends_.ids())
      if (m_.plan.stands_for[c] == c) order.push_back(c);
    std::sort(order.begin(), order.end(),
              [&](CornerId a, CornerId b) { return ends_[a].size() != ends_[b].size() ? ends_[a].size() > ends_[b].size() : a < b; });
    wanted_ = order;
    for (CornerId c : order) choose(c);
    for (CornerId c : order) reserve(c);
  }

 private:
  // The charts beside the route where it leaves its corner.
  [[nodiscard]] std::pair<ChartId, ChartId> beside(const Route& route, std::size_t which) const {
    const Features& features = m_.ground.features();
    const Curve& curve = features.curves[which == 0 ? route.curves.front() : route.curves.back()];
    if (!curve.manifold) return {};
    const Vec3& start = which == 0 ? route.points.front() : route.points.back();
    const bool forward = (m_.ground.surface().points[curve.points.front()] - start).squaredNorm() <=
                         (m_.ground.surface().points[curve.points.back()] - start).squaredNorm();
    const bool along = curve.closed ? which == 0 : forward;
    return along ? std::pair(curve.left, curve.right) : std::pair(curve.right, curve.left);
  }

  // `ends` by rising angle.
  void want_quads(CornerId c, std::vector<End>& ends) const {
    const Corner& corner = m_.ground.features().corners[c];
    for (std::size_t i = 0; i < ends.size(); ++i) {
      const ChartId after = ends[i].left, before = ends[(i + 1) % ends.size()].right;
      if (!after.valid() || !before.valid()) continue;
      const double angle = corner.angle_of(after) + (after == before ? 0 : corner.angle_of(before));
      ends[i].quads_after = std::max(1.0, angle / (0.5 * M_PI));
    }
  }

  Assignment assign(CornerId c, VertexId v, std::vector<End>& ends, std::vector<std::pair<double, std::int32_t>>& edges) const {
    ends = ends_[c];
    edges.clear();
    const Vec3 normal = skin_normal(m_, v), x = normal.unitOrthogonal(), y = normal.cross(x);
    const auto angle = [&](const Vec3& d) { return std::atan2(d.dot(y), d.dot(x)); };
    for (End& e : ends) e.angle = angle(e.direction);
    std::sort(ends.begin(), ends.end(),
              [](const End& a, const End& b) { return std::tie(a.angle, a.route, a.which) < std::tie(b.angle, b.route, b.which); });
    want_quads(c, ends);
    for (std::int32_t e : m_.skin.edges_round(v))
      edges.emplace_back(angle(m_.mesh.position[m_.skin.other_end(e, v)] - m_.mesh.position[v]), e);
    std::sort(edges.begin(), edges.end());
    if (ends.empty() || ends.size() > edges.size()) return {};
    return assign_in_order(ends, edges);
  }

  [[nodiscard]] const Vec3& place(CornerId c) const { return m_.ground.surface().points[m_.ground.features().corners[c].point]; }
  [[nodiscard]] bool nearer_to_other(CornerId c, const Vec3& p, VertexId v) const {
    const Vec3& at = m_.mesh.position[v];
    const double own = (at - p).squaredNorm();
    return std::any_of(wanted_.begin(), wanted_.end(),
                       [&](CornerId other) { return other != c && (at - place(other)).squaredNorm() < own; });
  }

  void choose(CornerId c) {
    choose_within(c, kReach);
    if (!m_.corner_vertex[c].valid()) choose_within(c, kFarReach);
    if (m_.corner_vertex[c].valid()) m_.corner_at[m_.corner_vertex[c]] = c;
  }

  void choose_within(CornerId c, double reach) {
    const Vec3 p = place(c);
    const VertexId nearest = m_.tree.nearest(p);
    if (!nearest.valid()) return;
    double best_cost = std::numeric_limits<double>::infinity();
    std::vector<End> ends;
    std::vector<std::pair<double, std::int32_t>> edges;
    for (VertexId v : m_.tree.within(p, reach * 1.5 * m_.size[nearest])) {
      const double d = (m_.mesh.position[v] - p).norm() / m_.size[v];
      if (d > reach || d > best_cost || m_.corner_at[v].valid()) continue;
      const auto spare = static_cast<int>(m_.skin.edges_round(v).size()) - static_cast<int>(ends_[c].size());
      double cost = d + (spare < 0 ? kMissingWeight * -spare : kSpareWeight * std::min(spare, 3));
      if (nearer_to_other(c, p, v)) cost += kNearerToOther;
      if (cost >= best_cost) continue;
      if (spare >= 0 && !ends_[c].empty()) cost += std::min(assign(c, v, ends, edges).cost, kMostForAngles);
      if (cost >= best_cost) continue;
      best_cost = cost;
      m_.corner_vertex[c] = v;
    }
  }

  void reserve(CornerId c) {
    const VertexId v = m_.corner_vertex[c];
    if (!v.valid()) return;
    std::vector<End> ends;
    std::vector<std::pair<double, std::int32_t>> edges;
    const Assignment assignment = assign(c, v, ends, edges);
    for (std::size_t i = 0; i < ends.size(); ++i) {
      Port& port = m_.ports[static_cast<std::size_t>(ends[i].route)][ends[i].which];
      port.vertex = v;
      if (assignment.choice.empty()) continue;
      port.edge = edges[static_cast<std::size_t>(assignment.choice[i])].second;
      const VertexId next = m_.skin.other_end(port.edge, v);
      if (!m_.corner_at[next].valid()) m_.reserved[next] = ends[i].route;
    }
  }

  Matching& m_;
  IdMap<CornerId, std::vector<End>> ends_;
  std::vector<CornerId> wanted_;
};

}  // namespace

void match_corners(Matching& m) { CornerMatcher(m).run(); }

}  // namespace strata
