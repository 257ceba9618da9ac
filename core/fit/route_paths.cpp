// Routes as edge paths: Dijkstra near the curve; a route that finds no way moves others aside, which then look for another way
// (negotiation as in the routing of circuits: what is fought over becomes dearer).
#include <algorithm>
#include <deque>
#include <limits>
#include <optional>
#include <queue>

#include "core/base/context.h"
#include "core/fit/matching.h"

namespace strata {
namespace {

constexpr double kReach = 1.5;           // a path keeps within so many local edge lengths of its curve
constexpr double kWideReach = 2.5;       // when there is no such path
constexpr double kDistanceWeight = 4.0;  // of (distance / edge length)^2 against length 1
constexpr double kTurnWeight = 1.0;      // of 1 - |cos(edge, tangent)| against length 1
constexpr double kReservedWeight = 10;   // factor for stepping on a vertex that another route would leave its corner by
constexpr double kEvictWeight = 4;       // edge lengths, for a vertex of another route, each time it is fought over
constexpr double kShortcut = 0.6;        // a path shorter than this share of its curve is a shortcut and gets an anchor
constexpr int kMaxSplits = 12;           // anchors against shortcuts
constexpr int kMaxFights = 6;            // times that a route may move others aside
constexpr double kAnchorReach = 2.0;     // an anchor is sought within so many local edge lengths

struct Way {
  double reach = kReach;
  bool free_ports = false;
  bool evict = false;
};

class Router {
 public:
  explicit Router(Matching& m)
      : m_(m), state_(m.mesh.position.size()), fought_(m.mesh.position.size(), std::uint8_t{0}), fights_(m.plan.routes.size(), 0) {}

  void run(Context& context) {
    std::deque<std::int32_t> waiting;
    for (std::size_t r = 0; r < m_.plan.routes.size(); ++r) waiting.push_back(static_cast<std::int32_t>(r));
    while (!waiting.empty()) {
      context.checkpoint();
      const std::int32_t r = waiting.front();
      waiting.pop_front();
      if (attempt(r, {kReach, false, false}) || attempt(r, {kWideReach, false, false})) continue;
      if (fights_[static_cast<std::size_t>(r)] < kMaxFights) {
        ++fights_[static_cast<std::size_t>(r)];
        if (attempt(r, {kReach, false, true}) || attempt(r, {kWideReach, true, true})) {
          waiting.insert(waiting.end(), evicted_.begin(), evicted_.end());
          continue;
        }
      }
      attempt(r, {kWideReach, true, false});
    }
  }

 private:
  struct State {
    double cost = 0;
    std::int32_t from = -1;
    std::uint32_t epoch = 0;   // of cost and from
    std::uint32_t seen = 0;    // of offset, tangent
    Vec3 offset = Vec3::Zero(), tangent = Vec3::Zero();  // from the curve
  };
  struct Piece {  // of a route between two arc lengths
    Port start, goal;
    double from = 0, to = 0;
  };

  [[nodiscard]] const Route& route() const { return m_.plan.routes[static_cast<std::size_t>(r_)]; }

  State& located(VertexId v) {
    State& s = state_[v];
    if (s.seen != route_epoch_) {
      s.seen = route_epoch_;
      const Polyline::Place at = route().line.closest(m_.mesh.position[v], hint_);
      hint_ = at.segment;
      s.offset = m_.mesh.position[v] - at.position;
      s.tangent = at.tangent;
    }
    return s;
  }

  // Length, made dearer by straying from the curve; infinite out of reach.
  double weight(VertexId v, VertexId u, const Way& way) {
    const Vec3 edge = m_.mesh.position[u] - m_.mesh.position[v];
    const double length = edge.norm();
    const State &a = located(v), &b = located(u);
    if (length == 0 || b.offset.norm() > way.reach * m_.size[u]) return std::numeric_limits<double>::infinity();
    const double h = 0.5 * (m_.size[u] + m_.size[v]);
    const Vec3 middle = 0.5 * (a.offset + b.offset);
    const double aside = (a.offset.squaredNorm() + b.offset.squaredNorm() + 4 * middle.squaredNorm()) / (6 * h * h);
    const double turn = 1 - std::abs(edge.dot(b.tangent)) / length;
    double cost = length * (1 + kDistanceWeight * aside + kTurnWeight * turn);
    if (m_.reserved[u] >= 0 && m_.reserved[u] != r_) cost *= kReservedWeight;
    if (const std::int32_t other = m_.route_at[u]; other >= 0 && other != r_) cost += kEvictWeight * h * (1 + fought_[u]);
    return cost;
  }

  [[nodiscard]] bool may_step(VertexId u, std::int32_t edge, VertexId goal, const Way& way) const {
    if (u == goal) return m_.route_of_edge[static_cast<std::size_t>(edge)] < 0;
    if (m_.corner_at[u].valid()) return false;
    const std::int32_t other = m_.route_at[u];
    if (other < 0) return true;
    if (other == r_ || !way.evict) return false;
    return route().border || !m_.plan.routes[static_cast<std::size_t>(other)].border;
  }

  std::optional<std::vector<std::int32_t>> shortest(const Port& start, const Port& goal, const Way& way) {
    ++epoch_;
    using Item = std::pair<double, std::int32_t>;
    std::priority_queue<Item, std::vector<Item>, std::greater<>> queue;
    State& origin = located(start.vertex);
    origin.cost = 0;
    origin.from = -1;
    origin.epoch = epoch_;
    queue.emplace(0.0, start.vertex.value);
    while (!queue.empty()) {
      const auto [cost, at] = queue.top();
      queue.pop();
      const VertexId v(at);
      if (cost > state_[v].cost) continue;
      if (v == goal.vertex) return walk_back(start.vertex, v);
      for (std::int32_t e : m_.skin.edges_round(v)) {
        if (!way.free_ports && v == start.vertex && start.edge >= 0 && e != start.edge) continue;
        const VertexId u = m_.skin.other_end(e, v);
        if (!way.free_ports && u == goal.vertex && goal.edge >= 0 && e != goal.edge) continue;
        if (!may_step(u, e, goal.vertex, way)) continue;
        const double next = cost + weight(v, u, way);
        if (!std::isfinite(next)) continue;
        State& s = state_[u];
        if (s.epoch == epoch_ && next >= s.cost) continue;
        s.cost = next;
        s.from = e;
        s.epoch = epoch_;
        queue.emplace(next, u.value);
      }
    }
    return std::nullopt;
  }

  [[nodiscard]] std::vector<std::int32_t> walk_back(VertexId start, VertexId v) const {
    std::vector<std::int32_t> path;
    while (v != start) {
      path.push_back(state_[v].from);
      v = m_.skin.other_end(path.back(), v);
    }
    std::reverse(path.begin(), path.end());
    return path;
  }

  [[nodiscard]] Vec3 along(double s) const {
    const auto& points = route().points;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const double length = (points[i + 1] - points[i]).norm();
      if (s <= length && length > 0) return points[i] + s / length * (points[i + 1] - points[i]);
      s -= length;
    }
    return points.back();
  }

  // A free vertex near a place on the curve, to pin a path or to start a closed one.
  [[nodiscard]] VertexId anchor_near(const Vec3& p, const std::vector<VertexId>& taken, const Way& way) const {
    const VertexId nearest = m_.tree.nearest(p);
    for (VertexId v : m_.tree.within(p, kAnchorReach * m_.size[nearest])) {
      if (m_.corner_at[v].valid() || m_.reserved[v] >= 0) continue;
      if (m_.route_at[v] >= 0 && (m_.route_at[v] == r_ || !way.evict)) continue;
      if (std::find(taken.begin(), taken.end(), v) == taken.end()) return v;
    }
    return {};
  }

  [[nodiscard]] std::vector<Piece> pieces(const Way& way) const {
    const double length = route().length;
    const auto& ports = m_.ports[static_cast<std::size_t>(r_)];
    if (route().first.valid()) {
      const Port &a = ports[0], &b = ports[1];
      if (!a.vertex.valid() || !b.vertex.valid()) return {};
      if (a.vertex != b.vertex) return {{a, b, 0, length}};
      const VertexId v = anchor_near(along(0.5 * length), {a.vertex}, way);
      if (!v.valid()) return {};
      return {{a, {v, -1}, 0, 0.5 * length}, {{v, -1}, b, 0.5 * length, length}};
    }
    std::vector<VertexId> anchors;
    for (int i = 0; i < 3; ++i) {
      anchors.push_back(anchor_near(along(i * length / 3), anchors, way));
      if (!anchors.back().valid()) return {};
    }
    const double third = length / 3;
    return {{{anchors[0], -1}, {anchors[1], -1}, 0, third},
            {{anchors[1], -1}, {anchors[2], -1}, third, 2 * third},
            {{anchors[2], -1}, {anchors[0], -1}, 2 * third, length}};
  }

  [[nodiscard]] double path_length(const std::vector<std::int32_t>& path) const {
    double sum = 0;
    for (std::int32_t e : path) {
      const SkinEdge& edge = m_.skin.edges()[static_cast<std::size_t>(e)];
      sum += (m_.mesh.position[edge.a] - m_.mesh.position[edge.b]).norm();
    }
    return sum;
  }

  void take(VertexId v) {
    if (m_.corner_at[v].valid() || m_.route_at[v] == r_) return;
    if (const std::int32_t other = m_.route_at[v]; other >= 0) {
      fought_[v] = static_cast<std::uint8_t>(std::min(fought_[v] + 1, 200));
      undo_.emplace_back(other, m_.path[static_cast<std::size_t>(other)]);
      evicted_.push_back(other);
      release(other);
    }
    m_.route_at[v] = r_;
    held_.push_back(v);
  }

  void release(std::int32_t r) {
    for (std::int32_t e : m_.path[static_cast<std::size_t>(r)]) {
      m_.route_of_edge[static_cast<std::size_t>(e)] = -1;
      const SkinEdge& edge = m_.skin.edges()[static_cast<std::size_t>(e)];
      for (VertexId v : {edge.a, edge.b})
        if (m_.route_at[v] == r) m_.route_at[v] = -1;
    }
    m_.path[static_cast<std::size_t>(r)].clear();
  }

  // All pieces or nothing; a piece whose path cuts short is halved. Who was moved aside is in evicted_ (also after a failure, which
  // gives their places back).
  bool attempt(std::int32_t r, const Way& way) {
    r_ = r;
    ++route_epoch_;
    hint_ = -1;
    evicted_.clear();
    undo_.clear();
    held_.clear();
    std::vector<Piece> todo = pieces(way);
    if (todo.empty()) return false;
    std::vector<std::int32_t>& path = m_.path[static_cast<std::size_t>(r)];
    const auto give_up = [&] {
      for (std::int32_t e : path) m_.route_of_edge[static_cast<std::size_t>(e)] = -1;
      for (VertexId v : held_) m_.route_at[v] = -1;
      path.clear();
      for (const auto& [other, was] : undo_) restore(other, was);
      evicted_.clear();
      return false;
    };
    std::vector<VertexId> anchors;
    for (const Piece& p : todo)
      for (const VertexId v : {p.start.vertex, p.goal.vertex}) {
        take(v);
        anchors.push_back(v);
      }
    int splits = 0;
    while (!todo.empty()) {
      const Piece piece = todo.back();
      todo.pop_back();
      const auto found = shortest(piece.start, piece.goal, way);
      if (!found) return give_up();
      const double wished = piece.to - piece.from;
      if (path_length(*found) < kShortcut * wished && wished > 3 * m_.size[piece.start.vertex] && splits < kMaxSplits) {
        const double middle = 0.5 * (piece.from + piece.to);
        const VertexId v = anchor_near(along(middle), anchors, way);
        if (!v.valid()) return give_up();
        ++splits;
        take(v);
        anchors.push_back(v);
        todo.push_back({piece.start, {v, -1}, piece.from, middle});
        todo.push_back({{v, -1}, piece.goal, middle, piece.to});
        continue;
      }
      for (std::int32_t e : *found) {
        const SkinEdge& edge = m_.skin.edges()[static_cast<std::size_t>(e)];
        take(edge.a);
        take(edge.b);
      }
      for (std::int32_t e : *found) {
        m_.route_of_edge[static_cast<std::size_t>(e)] = r;
        path.push_back(e);
      }
    }
    return true;
  }

  void restore(std::int32_t r, const std::vector<std::int32_t>& path) {
    m_.path[static_cast<std::size_t>(r)] = path;
    for (std::int32_t e : path) {
      m_.route_of_edge[static_cast<std::size_t>(e)] = r;
      const SkinEdge& edge = m_.skin.edges()[static_cast<std::size_t>(e)];
      for (VertexId v : {edge.a, edge.b})
        if (!m_.corner_at[v].valid()) m_.route_at[v] = r;
    }
  }

  Matching& m_;
  IdMap<VertexId, State> state_;
  IdMap<VertexId, std::uint8_t> fought_;
  std::vector<int> fights_;                // per route
  std::uint32_t epoch_ = 0, route_epoch_ = 0;
  std::int32_t r_ = -1, hint_ = -1;
  std::vector<std::int32_t> evicted_;
  std::vector<std::pair<std::int32_t, std::vector<std::int32_t>>> undo_;  // who was moved aside, and the paths they had
  std::vector<VertexId> held_;             // by the attempt under way
};

}  // namespace

void route_paths(Matching& m, Context& context) { Router(m).run(context); }

}  // namespace strata
