// Corners to vertices, curves to edge paths, charts to quads (Gao, Shen, Panozzo 2019 for the idea of routing curves on the boundary
// graph; the rules are ours). What cannot be represented is softened: the vertices slide on the surface, and it is reported.
#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <queue>
#include <string>
#include <tuple>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/fit/fit.h"
#include "core/fit/point_tree.h"
#include "core/fit/skin.h"

namespace strata {
namespace {

constexpr double kCornerReach = 2.0;     // a corner's vertex is sought within so many local edge lengths
constexpr double kCurveReach = 1.5;      // a path keeps within so many local edge lengths of its curve
constexpr double kWideCurveReach = 2.5;  // second try
constexpr double kDistanceWeight = 4.0;  // of (distance / edge length)^2 against length 1
constexpr double kTurnWeight = 1.0;      // of 1 - |cos(edge, tangent)| against length 1
constexpr double kReservedWeight = 10;   // factor for stepping on a vertex that another curve would leave its corner by
constexpr double kShortcut = 0.6;        // a path shorter than this share of its curve is a shortcut and gets an anchor
constexpr int kMaxSplits = 3;            // halvings of a curve to defeat shortcuts
constexpr int kSmoothLabelSweeps = 4;

struct Port {             // how a curve leaves a corner
  VertexId vertex;        // the corner's vertex
  std::int32_t edge = -1; // skin edge to leave by; -1: any
};

struct Matching {
  const HexMesh& mesh;
  const Ground& ground;
  const Skin& skin;
  IdMap<VertexId, double> size;                // local edge length
  IdMap<CornerId, VertexId> corner_vertex;     // invalid: no vertex represents the corner
  IdMap<VertexId, CornerId> corner_at;
  IdMap<VertexId, CurveId> curve_at;           // the path a vertex lies on
  IdMap<VertexId, CurveId> reserved;           // the curve that wants to leave its corner over this vertex
  std::vector<CurveId> path_of_edge;           // per skin edge
  IdMap<CurveId, std::array<Port, 2>> ports;
  IdMap<CurveId, std::uint8_t> routed;
};

Vec3 skin_normal(const HexMesh& mesh, const Skin& skin, VertexId v) {
  Vec3 normal = Vec3::Zero();
  for (std::int32_t e : skin.edges_round(v))
    for (QuadId q : skin.quads_of(skin.edges()[static_cast<std::size_t>(e)])) {
      const QuadVertices& c = mesh.quads[q];
      normal += (mesh.position[c[2]] - mesh.position[c[0]]).cross(mesh.position[c[3]] - mesh.position[c[1]]);
    }
  return normal.norm() > 0 ? Vec3(normal.normalized()) : Vec3::UnitZ();
}

// One vertex a corner: near, and with at least as many edges as curves leave the corner. Busy corners choose first.
void match_corners(Matching& m, const PointTree& tree, double largest_size) {
  const Features& features = m.ground.features();
  std::vector<CornerId> order;
  for (CornerId c : features.corners.ids()) order.push_back(c);
  std::sort(order.begin(), order.end(), [&](CornerId a, CornerId b) {
    const std::size_t na = features.corners[a].curves.size(), nb = features.corners[b].curves.size();
    return na != nb ? na > nb : a < b;
  });
  for (CornerId c : order) {
    const Corner& corner = features.corners[c];
    const Vec3 p = m.ground.surface().points[corner.point];
    double best_cost = std::numeric_limits<double>::infinity();
    for (VertexId v : tree.within(p, kCornerReach * largest_size)) {
      const double d = (m.mesh.position[v] - p).norm() / m.size[v];
      if (d > kCornerReach || d > best_cost) continue;
      if (m.corner_at[v].valid()) continue;
      const auto spare = static_cast<int>(m.skin.edges_round(v).size()) - static_cast<int>(corner.curves.size());
      if (spare < 0) continue;
      const double cost = d + 0.15 * std::min(spare, 3);
      if (cost < best_cost) {
        best_cost = cost;
        m.corner_vertex[c] = v;
      }
    }
    if (m.corner_vertex[c].valid()) m.corner_at[m.corner_vertex[c]] = c;
  }
}

// Place on the curve at arc length s from its first point (or from its last point, backwards).
Vec3 along(const Surface& surface, const Curve& curve, bool from_last, double s) {
  const auto n = curve.points.size();
  const std::size_t segments = curve.closed ? n : n - 1;
  const auto point = [&](std::size_t i) -> const Vec3& {
    const std::size_t k = from_last ? (curve.closed ? (n - i % n) % n : n - 1 - i) : i % n;
    return surface.points[curve.points[k]];
  };
  for (std::size_t i = 0; i < segments; ++i) {
    const double length = (point(i + 1) - point(i)).norm();
    if (s <= length) return point(i) + (length > 0 ? s / length : 0.0) * (point(i + 1) - point(i));
    s -= length;
  }
  return point(segments);
}

// The injective assignment of curve ends to edges that keeps the cyclic order and turns least.
std::vector<std::int32_t> assign_in_order(const std::vector<double>& curve_angles, const std::vector<double>& edge_angles) {
  const auto k = static_cast<int>(curve_angles.size()), n = static_cast<int>(edge_angles.size());
  std::vector<std::int32_t> best(curve_angles.size(), -1), chosen(curve_angles.size(), -1);
  double best_cost = std::numeric_limits<double>::infinity();
  const auto turn = [](double a, double b) {
    const double d = std::remainder(a - b, 2 * M_PI);
    return d * d;
  };
  // Edges are tried in rising cyclic order from each possible first edge.
  const auto extend = [&](auto&& self, int curve, int first, int from, double cost) -> void {
    if (cost >= best_cost) return;
    if (curve == k) {
      best_cost = cost;
      best = chosen;
      return;
    }
    for (int step = from; step <= n - (k - curve); ++step) {
      const int e = (first + step) % n;
      chosen[static_cast<std::size_t>(curve)] = e;
      self(self, curve + 1, first, step + 1, cost + turn(curve_angles[static_cast<std::size_t>(curve)], edge_angles[static_cast<std::size_t>(e)]));
    }
  };
  for (int first = 0; first < n; ++first) {
    chosen[0] = first;
    extend(extend, 1, first, 1, turn(curve_angles[0], edge_angles[static_cast<std::size_t>(first)]));
  }
  return best;
}

void reserve_ports(Matching& m) {
  const Features& features = m.ground.features();
  for (CornerId c : features.corners.ids()) {
    const VertexId v = m.corner_vertex[c];
    if (!v.valid() || features.corners[c].curves.empty()) continue;
    const Vec3 normal = skin_normal(m.mesh, m.skin, v);
    const Vec3 x = normal.unitOrthogonal(), y = normal.cross(x);
    const auto angle = [&](const Vec3& d) { return std::atan2(d.dot(y), d.dot(x)); };
    const Vec3 p = m.ground.surface().points[features.corners[c].point];

    struct End {
      double angle;
      CurveId curve;
      int which;  // 0 starts here, 1 ends here
    };
    std::vector<End> ends;
    for (CurveId curve_id : features.corners[c].curves) {
      const Curve& curve = features.curves[curve_id];
      for (int which = 0; which < 2; ++which) {
        if ((which == 0 ? curve.first : curve.last) != c) continue;
        const bool known = std::any_of(ends.begin(), ends.end(), [&](const End& e) { return e.curve == curve_id && e.which == which; });
        if (known) continue;  // a loop is listed twice
        const double reach = std::min(m.size[v], 0.5 * curve.length);
        ends.push_back({angle(along(m.ground.surface(), curve, which == 1, reach) - p), curve_id, which});
      }
    }
    std::sort(ends.begin(), ends.end(), [](const End& a, const End& b) { return std::tie(a.angle, a.curve, a.which) < std::tie(b.angle, b.curve, b.which); });
    std::vector<std::pair<double, std::int32_t>> edges;
    for (std::int32_t e : m.skin.edges_round(v)) edges.emplace_back(angle(m.mesh.position[m.skin.other_end(e, v)] - m.mesh.position[v]), e);
    std::sort(edges.begin(), edges.end());
    if (ends.size() > edges.size()) continue;
    std::vector<double> curve_angles, edge_angles;
    for (const End& e : ends) curve_angles.push_back(e.angle);
    for (const auto& e : edges) edge_angles.push_back(e.first);
    const std::vector<std::int32_t> choice = assign_in_order(curve_angles, edge_angles);
    for (std::size_t i = 0; i < ends.size(); ++i) {
      if (choice[i] < 0) continue;
      const std::int32_t e = edges[static_cast<std::size_t>(choice[i])].second;
      m.ports[ends[i].curve][static_cast<std::size_t>(ends[i].which)] = {v, e};
      const VertexId next = m.skin.other_end(e, v);
      if (!m.corner_at[next].valid()) m.reserved[next] = ends[i].curve;
    }
  }
}

// Dijkstra on skin edges near the curve, on free vertices only. Scratch arrays are kept between calls.
class Router {
 public:
  explicit Router(const Matching& m) : m_(m), cost_(m.mesh.position.size()), from_(m.mesh.position.size(), -1), stamp_(m.mesh.position.size(), 0), distance_(m.mesh.position.size(), 0), hint_(-1) {}

  // Edges of the cheapest path, or nothing.
  std::optional<std::vector<std::int32_t>> route(CurveId curve, const Port& start, const Port& goal, double reach) {
    ++epoch_;
    curve_ = curve;
    reach_ = reach;
    using Item = std::pair<double, std::int32_t>;
    std::priority_queue<Item, std::vector<Item>, std::greater<>> queue;
    reach_vertex(start.vertex, 0, -1);
    queue.emplace(0.0, start.vertex.value);
    const double longest = 4 * m_.ground.features().curves[curve].length + 20 * m_.size[start.vertex];
    while (!queue.empty()) {
      const auto [cost, at] = queue.top();
      queue.pop();
      const VertexId v(at);
      if (cost > cost_[v.index()]) continue;
      if (v == goal.vertex) return path_to(start.vertex, v);
      if (cost > 10 * longest) return std::nullopt;
      for (std::int32_t e : m_.skin.edges_round(v)) {
        if (v == start.vertex && start.edge >= 0 && e != start.edge) continue;
        const VertexId u = m_.skin.other_end(e, v);
        if (u == goal.vertex && goal.edge >= 0 && e != goal.edge) continue;
        if (!free_to_step(u, goal.vertex) || m_.path_of_edge[static_cast<std::size_t>(e)].valid()) continue;
        const double next = cost + weight(v, u);
        if (!std::isfinite(next)) continue;
        if (stamp_[u.index()] == epoch_ && next >= cost_[u.index()]) continue;
        reach_vertex(u, next, e);
        queue.emplace(next, u.value);
      }
    }
    return std::nullopt;
  }

 private:
  void reach_vertex(VertexId v, double cost, std::int32_t edge) {
    if (stamp_[v.index()] != epoch_) {
      stamp_[v.index()] = epoch_;
      distance_[v.index()] = distance_to_curve(m_.mesh.position[v]);
    }
    cost_[v.index()] = cost;
    from_[v.index()] = edge;
  }
  [[nodiscard]] bool free_to_step(VertexId u, VertexId goal) const {
    return u == goal || (!m_.corner_at[u].valid() && !m_.curve_at[u].valid());
  }
  double distance_to_curve(const Vec3& p) {
    const Foothold f = m_.ground.project({Hold::Curve, curve_.value}, p, hint_);
    hint_ = f.hint;
    tangent_ = f.direction;
    return (f.position - p).norm();
  }
  double weight(VertexId v, VertexId u) {
    const Vec3 edge = m_.mesh.position[u] - m_.mesh.position[v];
    const double length = edge.norm();
    if (length == 0) return std::numeric_limits<double>::infinity();
    const double h = 0.5 * (m_.size[u] + m_.size[v]);
    const double du = distance_to_curve(m_.mesh.position[u]);
    if (du > reach_ * m_.size[u]) return std::numeric_limits<double>::infinity();
    const double dm = distance_to_curve(m_.mesh.position[v] + 0.5 * edge);
    const double aside = (du * du + 2 * dm * dm) / (3 * h * h);
    const double turn = 1 - std::abs(edge.dot(tangent_)) / length;
    const double crowd = m_.reserved[u].valid() && m_.reserved[u] != curve_ ? kReservedWeight : 1.0;
    return crowd * length * (1 + kDistanceWeight * aside + kTurnWeight * turn);
  }
  [[nodiscard]] std::vector<std::int32_t> path_to(VertexId start, VertexId v) const {
    std::vector<std::int32_t> path;
    while (v != start || path.empty()) {
      const std::int32_t e = from_[v.index()];
      if (e < 0) break;
      path.push_back(e);
      v = m_.skin.other_end(e, v);
    }
    std::reverse(path.begin(), path.end());
    return path;
  }

  const Matching& m_;
  std::vector<double> cost_;
  std::vector<std::int32_t> from_;
  std::vector<std::uint32_t> stamp_;
  std::vector<double> distance_;
  std::uint32_t epoch_ = 0;
  CurveId curve_;
  double reach_ = 0;
  std::int32_t hint_;
  Vec3 tangent_ = Vec3::Zero();
};

// A free vertex near a place on the curve, to pin a path or to start a closed one.
VertexId anchor_near(const Matching& m, const PointTree& tree, const Vec3& p, double largest_size, const std::vector<VertexId>& taken) {
  for (VertexId v : tree.within(p, kCornerReach * largest_size)) {
    if (m.corner_at[v].valid() || m.curve_at[v].valid() || m.reserved[v].valid()) continue;
    if ((m.mesh.position[v] - p).norm() > kCornerReach * m.size[v]) continue;
    if (std::find(taken.begin(), taken.end(), v) == taken.end()) return v;
  }
  return {};
}

double path_length(const Matching& m, const std::vector<std::int32_t>& path) {
  double sum = 0;
  for (std::int32_t e : path) {
    const SkinEdge& edge = m.skin.edges()[static_cast<std::size_t>(e)];
    sum += (m.mesh.position[edge.a] - m.mesh.position[edge.b]).norm();
  }
  return sum;
}

struct Piece {  // of a curve between two arc lengths, to be routed between two vertices
  Port start, goal;
  double from = 0, to = 0;
};

void claim(Matching& m, CurveId curve, const std::vector<std::int32_t>& path) {
  for (std::int32_t e : path) {
    m.path_of_edge[static_cast<std::size_t>(e)] = curve;
    const SkinEdge& edge = m.skin.edges()[static_cast<std::size_t>(e)];
    for (VertexId v : {edge.a, edge.b})
      if (!m.corner_at[v].valid()) m.curve_at[v] = curve;
  }
}

void unclaim(Matching& m, CurveId curve, const std::vector<std::int32_t>& path) {
  for (std::int32_t e : path) {
    m.path_of_edge[static_cast<std::size_t>(e)] = {};
    const SkinEdge& edge = m.skin.edges()[static_cast<std::size_t>(e)];
    for (VertexId v : {edge.a, edge.b})
      if (m.curve_at[v] == curve) m.curve_at[v] = {};
  }
}

// Routes the pieces one after the other, halving a piece whose path cuts short. All or nothing.
bool route_pieces(Matching& m, Router& router, const PointTree& tree, double largest_size, CurveId curve_id, std::vector<Piece> pieces, double reach, bool free_ports) {
  const Curve& curve = m.ground.features().curves[curve_id];
  std::vector<std::int32_t> claimed;
  std::vector<VertexId> anchors;
  // Anchors belong to the curve from the start, so that no piece runs over another's.
  const auto pin = [&](VertexId v) {
    anchors.push_back(v);
    if (!m.corner_at[v].valid()) m.curve_at[v] = curve_id;
  };
  const auto give_up = [&] {
    unclaim(m, curve_id, claimed);
    for (VertexId v : anchors)
      if (m.curve_at[v] == curve_id) m.curve_at[v] = {};
    return false;
  };
  for (const Piece& p : pieces) {
    pin(p.start.vertex);
    pin(p.goal.vertex);
  }
  int splits = 0;
  while (!pieces.empty()) {
    Piece piece = pieces.back();
    pieces.pop_back();
    if (free_ports) piece.start.edge = piece.goal.edge = -1;
    const auto path = router.route(curve_id, piece.start, piece.goal, reach);
    if (!path) return give_up();
    const double wished = piece.to - piece.from;
    if (path_length(m, *path) < kShortcut * wished && wished > 3 * m.size[piece.start.vertex] && splits < kMaxSplits * 4) {
      const double middle = 0.5 * (piece.from + piece.to);
      const VertexId v = anchor_near(m, tree, along(m.ground.surface(), curve, false, middle), largest_size, anchors);
      if (!v.valid()) return give_up();
      ++splits;
      pin(v);
      pieces.push_back({piece.start, {v, -1}, piece.from, middle});
      pieces.push_back({{v, -1}, piece.goal, middle, piece.to});
      continue;
    }
    claim(m, curve_id, *path);
    claimed.insert(claimed.end(), path->begin(), path->end());
  }
  return true;
}

std::vector<Piece> pieces_of(Matching& m, const PointTree& tree, double largest_size, CurveId curve_id) {
  const Curve& curve = m.ground.features().curves[curve_id];
  if (!curve.closed || curve.first.valid()) {
    const Port& a = m.ports[curve_id][0];
    const Port& b = m.ports[curve_id][1];
    if (!a.vertex.valid() || !b.vertex.valid()) return {};
    if (a.vertex != b.vertex) return {{a, b, 0, curve.length}};
    const VertexId v = anchor_near(m, tree, along(m.ground.surface(), curve, false, 0.5 * curve.length), largest_size, {a.vertex});
    if (!v.valid()) return {};
    return {{a, {v, -1}, 0, 0.5 * curve.length}, {{v, -1}, b, 0.5 * curve.length, curve.length}};
  }
  std::vector<VertexId> anchors;
  for (int i = 0; i < 3; ++i) {
    const VertexId v = anchor_near(m, tree, along(m.ground.surface(), curve, false, i * curve.length / 3), largest_size, anchors);
    if (!v.valid()) return {};
    anchors.push_back(v);
  }
  const double third = curve.length / 3;
  return {{{anchors[0], -1}, {anchors[1], -1}, 0, third},
          {{anchors[1], -1}, {anchors[2], -1}, third, 2 * third},
          {{anchors[2], -1}, {anchors[0], -1}, 2 * third, curve.length}};
}

void route_curves(Matching& m, const PointTree& tree, double largest_size, Context& context) {
  const Features& features = m.ground.features();
  std::vector<CurveId> order;
  for (CurveId c : features.curves.ids()) order.push_back(c);
  std::sort(order.begin(), order.end(), [&](CurveId a, CurveId b) {
    return std::make_tuple(-features.curves[a].length, a) < std::make_tuple(-features.curves[b].length, b);
  });
  Router router(m);
  for (CurveId c : order) {
    context.checkpoint();
    for (int attempt = 0; attempt < 3 && m.routed[c] == 0; ++attempt) {
      const std::vector<Piece> pieces = pieces_of(m, tree, largest_size, c);
      if (pieces.empty()) break;
      const double reach = attempt == 0 ? kCurveReach : kWideCurveReach;
      m.routed[c] = route_pieces(m, router, tree, largest_size, c, pieces, reach, attempt == 2) ? 1 : 0;
    }
  }
}

// Connected quads between paths.
IdMap<QuadId, std::int32_t> flood(const Matching& m) {
  IdMap<QuadId, std::int32_t> parent(m.mesh.quads.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t q) {
    while (parent[QuadId(q)] != q) q = parent[QuadId(q)] = parent[QuadId(parent[QuadId(q)])];
    return q;
  };
  for (std::size_t e = 0; e < m.skin.edges().size(); ++e) {
    const SkinEdge& edge = m.skin.edges()[e];
    if (edge.count != 2 || m.path_of_edge[e].valid()) continue;
    const auto quads = m.skin.quads_of(edge);
    const std::int32_t a = root(quads[0].value), b = root(quads[1].value);
    parent[QuadId(std::max(a, b))] = std::min(a, b);
  }
  for (QuadId q : parent.ids()) parent[q] = root(q.value);
  return parent;
}

// A region bounded by paths takes the chart most of its area lies on. Where a curve was softened several charts share a region: there
// each quad takes the chart it lies on, smoothed by its neighbours.
void label_quads(const Matching& m, HexMesh& mesh) {
  const Features& features = m.ground.features();
  const std::size_t quad_count = mesh.quads.size();
  IdMap<QuadId, ChartId> nearest(quad_count);
  IdMap<QuadId, double> area(quad_count);
  parallel_for(quad_count, [&](std::size_t i) {
    const QuadVertices& q = mesh.quads[QuadId(i)];
    const Vec3 &a = mesh.position[q[0]], &b = mesh.position[q[1]], &c = mesh.position[q[2]], &d = mesh.position[q[3]];
    nearest[QuadId(i)] = features.chart[m.ground.closest(0.25 * (a + b + c + d)).triangle];
    area[QuadId(i)] = 0.5 * (c - a).cross(d - b).norm();
  });

  const IdMap<QuadId, std::int32_t> region = flood(m);
  struct Vote {
    std::int32_t region;
    ChartId chart;
    double area;
  };
  std::vector<Vote> votes;
  votes.reserve(quad_count);
  for (QuadId q : mesh.quads.ids()) votes.push_back({region[q], nearest[q], area[q]});
  std::stable_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) { return std::tie(a.region, a.chart) < std::tie(b.region, b.chart); });
  IdMap<ChartId, std::uint8_t> soft(features.chart_count(), 0);  // charts beside a softened curve
  for (CurveId c : features.curves.ids())
    if (m.routed[c] == 0)
      for (ChartId chart : {features.curves[c].left, features.curves[c].right})
        if (chart.valid()) soft[chart] = 1;

  IdMap<QuadId, ChartId> of_region(quad_count);   // by the region's root quad; invalid: mixed
  for (std::size_t i = 0; i < votes.size();) {
    const std::int32_t r = votes[i].region;
    ChartId best;
    double best_area = -1;
    double soft_area = 0, whole = 0;
    while (i < votes.size() && votes[i].region == r) {
      const ChartId chart = votes[i].chart;
      double sum = 0;
      for (; i < votes.size() && votes[i].region == r && votes[i].chart == chart; ++i) sum += votes[i].area;
      whole += sum;
      if (soft[chart]) soft_area += sum;
      if (sum > best_area) {
        best_area = sum;
        best = chart;
      }
    }
    const bool mixed = best_area < 0.97 * whole && soft_area > 0 && soft[best];
    if (!mixed) of_region[QuadId(r)] = best;
  }
  mesh.chart.assign(quad_count, ChartId());
  for (QuadId q : mesh.quads.ids()) {
    const ChartId chart = of_region[QuadId(region[q])];
    mesh.chart[q] = chart.valid() ? chart : nearest[q];
  }
  // Mixed regions: a quad with three or more neighbours of one other chart follows them.
  for (int sweep = 0; sweep < kSmoothLabelSweeps; ++sweep) {
    IdMap<QuadId, ChartId> next = mesh.chart;
    for (QuadId q : mesh.quads.ids()) {
      if (of_region[QuadId(region[q])].valid()) continue;
      const QuadVertices& c = mesh.quads[q];
      std::array<ChartId, 4> around;
      std::size_t n = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        const std::int32_t e = m.skin.edge_between(c[k], c[(k + 1) & 3]);
        const SkinEdge& edge = m.skin.edges()[static_cast<std::size_t>(e)];
        if (edge.count != 2 || m.path_of_edge[static_cast<std::size_t>(e)].valid()) continue;
        const auto quads = m.skin.quads_of(edge);
        around[n++] = mesh.chart[quads[0] == q ? quads[1] : quads[0]];
      }
      std::sort(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(n));
      for (std::size_t k = 0; k + 2 < n; ++k)
        if (around[k] == around[k + 2] && around[k] != mesh.chart[q]) next[q] = around[k];
    }
    mesh.chart = std::move(next);
  }
  mesh.patch.assign(quad_count, PatchId());
  for (QuadId q : mesh.quads.ids()) mesh.patch[q] = features.patch_of_chart[mesh.chart[q]];
}

void attach(const Matching& m, HexMesh& mesh) {
  for (VertexId v : m.skin.vertices()) {
    if (m.corner_at[v].valid()) {
      mesh.attachment[v] = {Hold::Corner, m.corner_at[v].value};
    } else if (m.curve_at[v].valid()) {
      mesh.attachment[v] = {Hold::Curve, m.curve_at[v].value};
    } else {
      ChartId chart;
      bool several = false;
      for (std::int32_t e : m.skin.edges_round(v))
        for (QuadId q : m.skin.quads_of(m.skin.edges()[static_cast<std::size_t>(e)])) {
          several = several || (chart.valid() && mesh.chart[q] != chart);
          chart = mesh.chart[q];
        }
      mesh.attachment[v] = {Hold::Chart, several ? kWholeSurface : chart.value};
    }
  }
}

void report(const Matching& m, std::int64_t softened, Context& context) {
  if (softened == 0) return;
  const Features& features = m.ground.features();
  const Surface& surface = m.ground.surface();
  Diagnostic diagnostic;
  diagnostic.reason = Reason::FeatureSoftened;
  diagnostic.severity = Severity::Warning;
  double length = 0;
  for (CurveId c : features.curves.ids()) {
    if (m.routed[c]) continue;
    length += features.curves[c].length / surface.frame.scale;
    for (PointId p : features.curves[c].points) diagnostic.box.add(surface.frame.to_input(surface.points[p]));
  }
  diagnostic.count = softened;
  diagnostic.values = {{"curves", static_cast<double>(softened)}, {"length", length}};
  diagnostic.message = std::to_string(softened) + " feature curves (length " + std::to_string(length) +
                       " in all) have no path of mesh edges; the mesh rounds them off. A smaller size there keeps them.";
  context.adjusted(std::move(diagnostic));
}

}  // namespace

FitResult match_features(HexMesh mesh, const Ground& ground, Context& context) {
  const Features& features = ground.features();
  const Skin skin(mesh);
  const std::size_t n = mesh.position.size();
  Matching m{mesh,
             ground,
             skin,
             IdMap<VertexId, double>(n),
             IdMap<CornerId, VertexId>(features.corners.size()),
             IdMap<VertexId, CornerId>(n),
             IdMap<VertexId, CurveId>(n),
             IdMap<VertexId, CurveId>(n),
             std::vector<CurveId>(skin.edges().size()),
             IdMap<CurveId, std::array<Port, 2>>(features.curves.size()),
             IdMap<CurveId, std::uint8_t>(features.curves.size(), 0)};
  double largest_size = 0;
  for (VertexId v : skin.vertices()) {
    m.size[v] = skin.size_at(mesh, v);
    largest_size = std::max(largest_size, m.size[v]);
  }
  if (!features.curves.empty() || !features.corners.empty()) {
    const PointTree tree(mesh, skin.vertices());
    match_corners(m, tree, largest_size);
    reserve_ports(m);
    route_curves(m, tree, largest_size, context);
  }
  FitResult result;
  for (CurveId c : features.curves.ids()) result.softened += m.routed[c] ? 0 : 1;
  HexMesh labelled = mesh;
  label_quads(m, labelled);
  attach(m, labelled);
  report(m, result.softened, context);
  result.mesh = std::move(labelled);
  return result;
}

}  // namespace strata
