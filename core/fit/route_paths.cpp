// Routes as edge paths: Dijkstra near the curve; a route that finds no way moves others aside, which then look for another way
// (negotiation as in the routing of circuits: what is fought over becomes dearer).
#include <algorithm>
#include <array>
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
constexpr double kEndReach = 1.5;        // near a corner, times the distance from it to its vertex
constexpr double kDistanceWeight = 4.0;  // of (distance / edge length)^2 against length 1
constexpr double kTurnWeight = 1.0;      // of 1 - |cos(edge, tangent)| against length 1
constexpr double kReservedWeight = 10;   // factor for stepping on a vertex that another route would leave its corner by
constexpr double kEvictWeight = 4;       // edge lengths, for a vertex of another route, each time it is fought over
constexpr double kShortcut = 0.6;        // a path shorter than this share of its curve is a shortcut and gets an anchor
constexpr int kMaxSplits = 12;           // anchors against shortcuts
constexpr int kMaxFights = 6;            // times that a route may move others aside
constexpr int kSharedEdges = 3;  // of another route's path from the corner, that a route may share at a corner without an edge for it
constexpr double kSharedWeight = 2;  // of their length
constexpr double kAnchorReach = 2.0;  // an anchor is sought within so many local edge lengths
constexpr std::size_t kStarts = 6;  // vertices that a closed path is tried from, at each of kStartPlaces along the curve
constexpr int kStartPlaces = 3;
constexpr int kZones = 3;  // of a closed curve; a path passes them in order, so that it goes round once

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
    join_others();
  }

 private:
  struct State {
    double cost = 0;
    std::int32_t from = -1;
    std::uint32_t epoch = 0;  // of cost and from
    std::uint32_t seen = 0;  // of offset, tangent
    Vec3 offset = Vec3::Zero(), tangent = Vec3::Zero();  // from the curve
    double arc = 0;  // along the curve
  };
  using Queue = std::priority_queue<std::pair<double, std::int32_t>, std::vector<std::pair<double, std::int32_t>>, std::greater<>>;
  struct Branch {  // where a path may begin: at its corner or, where that has no edge left, on the path of another route that leaves there
    VertexId at;
    double cost = 0;
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
      const auto segment = static_cast<std::size_t>(at.segment);
      s.arc = arcs_[segment] + (at.position - route().points[segment]).norm();
    }
    return s;
  }

  // Where cells end far short of a corner, paths have as far to go as the corner's vertex has, near there.
  [[nodiscard]] double reach_at(double arc) const {
    double reach = 0;
    for (const std::size_t which : {0, 1})
      if ((which == 0 ? arc : route().length - arc) < kEndReach * end_offset_[which])
        reach = std::max(reach, kEndReach * end_offset_[which]);
    return reach;
  }

  // Length, made dearer by straying from the curve; infinite out of reach.
  double weight(VertexId v, VertexId u, const Way& way) {
    const Vec3 edge = m_.mesh.position[u] - m_.mesh.position[v];
    const double length = edge.norm();
    const State &a = located(v), &b = located(u);
    if (length == 0 || b.offset.norm() > std::max(way.reach * m_.size[u], reach_at(b.arc))) return std::numeric_limits<double>::infinity();
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

  // The vertex may be reached along the edge at that cost: what is cheapest counts.
  void reach(VertexId v, std::int32_t edge, double cost, Queue& queue) {
    State& s = state_[v];
    if (s.epoch == epoch_ && cost >= s.cost) return;
    s.cost = cost;
    s.from = edge;
    s.epoch = epoch_;
    queue.emplace(cost, v.value);
  }

  std::optional<std::vector<std::int32_t>> shortest(const Port& start, const Port& goal, const Way& way) {
    ++epoch_;
    Queue queue;
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
        reach(u, e, next, queue);
      }
    }
    return std::nullopt;
  }

  // The vertex of the route's end and, along the paths of others that leave there, those next to it.
  [[nodiscard]] std::vector<Branch> branches(VertexId corner) const {
    std::vector<Branch> result{{corner, 0}};
    for (std::int32_t first : m_.skin.edges_round(corner)) {
      const std::int32_t other = m_.route_of_edge[static_cast<std::size_t>(first)];
      if (other < 0) continue;
      Branch branch{corner, 0};
      for (std::int32_t e = first, shared = 0; e >= 0 && shared < kSharedEdges; ++shared) {
        const VertexId from = branch.at;
        branch.at = m_.skin.other_end(e, from);
        if (m_.corner_at[branch.at].valid() || m_.route_at[branch.at] != other) break;
        branch.cost += kSharedWeight * (m_.mesh.position[branch.at] - m_.mesh.position[from]).norm();
        result.push_back(branch);
        const std::int32_t last = e;
        e = -1;
        for (std::int32_t next : m_.skin.edges_round(branch.at))
          if (next != last && m_.route_of_edge[static_cast<std::size_t>(next)] == other) e = next;
      }
    }
    return result;
  }

  // A way from one of the branches to another of the branches of the other end, over vertices and edges that are nobody's.
  std::optional<std::vector<std::int32_t>> shortest_between(const std::vector<Branch>& starts, const std::vector<Branch>& goals,
                                                            const Way& way) {
    ++epoch_;
    Queue queue;
    const auto branch_at = [](const std::vector<Branch>& branches, VertexId v) {
      return std::find_if(branches.begin(), branches.end(), [&](const Branch& b) { return b.at == v; });
    };
    for (const Branch& b : starts) {
      State& origin = located(b.at);
      origin.cost = b.cost;
      origin.from = -1;
      origin.epoch = epoch_;
      queue.emplace(b.cost, b.at.value);
    }
    struct {
      double cost = std::numeric_limits<double>::infinity();
      VertexId from;
      std::int32_t edge = -1;
    } best;
    while (!queue.empty() && queue.top().first < best.cost) {
      const auto [cost, at] = queue.top();
      queue.pop();
      const VertexId v(at);
      if (cost > state_[v].cost) continue;
      for (std::int32_t e : m_.skin.edges_round(v)) {
        const VertexId u = m_.skin.other_end(e, v);
        if (m_.route_of_edge[static_cast<std::size_t>(e)] >= 0 || branch_at(starts, u) != starts.end()) continue;
        const auto goal = branch_at(goals, u);
        if (goal == goals.end() && !may_step(u, e, {}, way)) continue;
        const double next = cost + weight(v, u, way) + (goal == goals.end() ? 0 : goal->cost);
        if (!(next < best.cost)) continue;
        if (goal != goals.end()) {
          best = {next, v, e};
          continue;
        }
        reach(u, e, next, queue);
      }
    }
    if (best.edge < 0) return std::nullopt;
    std::vector<std::int32_t> path;
    VertexId v = best.from;
    while (state_[v].from >= 0) {
      path.push_back(state_[v].from);
      v = m_.skin.other_end(path.back(), v);
    }
    std::reverse(path.begin(), path.end());
    path.push_back(best.edge);
    return path;
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

  struct Round {
    double cost = std::numeric_limits<double>::infinity();
    std::vector<std::int32_t> path;
  };

  // The cheapest way once round a closed curve, from a vertex to itself; empty when it would cost `limit` or more.
  Round shortest_round(VertexId start, const std::array<Port, 2>& ports, const Way& way, double limit) {
    ++epoch_;
    const double length = route().length, origin_arc = located(start).arc;
    const auto zone = [&](VertexId v) {
      const double arc = located(v).arc - origin_arc;
      return std::min(static_cast<int>(kZones * (arc < 0 ? arc + length : arc) / length), kZones - 1);
    };
    Queue queue;
    State& origin = state_[start];
    origin.cost = std::numeric_limits<double>::infinity();
    origin.epoch = epoch_;
    const auto relax = [&](VertexId v, double cost, std::int32_t e) {
      const VertexId u = m_.skin.other_end(e, v);
      const bool leaves = v == start, arrives = u == start;
      if (!way.free_ports && leaves && ports[0].edge >= 0 && e != ports[0].edge) return;
      if (!way.free_ports && arrives && ports[1].edge >= 0 && e != ports[1].edge) return;
      const int from = leaves ? 0 : zone(v), to = arrives ? kZones : zone(u);
      if (to != from && to != from + 1) return;
      if (!may_step(u, e, start, way)) return;
      const double next = cost + weight(v, u, way);
      if (next < limit) reach(u, e, next, queue);
    };
    for (std::int32_t e : m_.skin.edges_round(start)) relax(start, 0, e);
    while (!queue.empty()) {
      const auto [cost, at] = queue.top();
      queue.pop();
      const VertexId v(at);
      if (cost > state_[v].cost) continue;
      if (v == start) {
        std::vector<std::int32_t> path = {origin.from};
        const std::vector<std::int32_t> rest = walk_back(start, m_.skin.other_end(origin.from, start));
        path.insert(path.begin(), rest.begin(), rest.end());
        return {cost, std::move(path)};
      }
      for (std::int32_t e : m_.skin.edges_round(v)) relax(v, cost, e);
    }
    return {};
  }

  // A closed path: through its corner's vertex, or through the start it is cheapest from.
  [[nodiscard]] std::vector<std::int32_t> closed_path(const Way& way) {
    const auto& ports = m_.ports[static_cast<std::size_t>(r_)];
    Round best;
    if (route().first.valid()) {
      if (ports[0].vertex.valid()) best = shortest_round(ports[0].vertex, ports, way, best.cost);
      return best.path;
    }
    for (int i = 0; i < kStartPlaces && best.path.empty(); ++i)
      for (VertexId v : starts_near(along(i * route().length / kStartPlaces), way)) {
        Round found = shortest_round(v, {}, way, best.cost);
        if (!found.path.empty()) best = std::move(found);
      }
    return best.path;
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

  [[nodiscard]] bool may_hold(VertexId v, const Way& way) const {
    if (m_.corner_at[v].valid() || m_.reserved[v] >= 0) return false;
    return m_.route_at[v] < 0 || (m_.route_at[v] != r_ && way.evict);
  }
  // A free vertex near a place on the curve, to pin a path.
  [[nodiscard]] VertexId anchor_near(const Vec3& p, const std::vector<VertexId>& taken, const Way& way) const {
    const VertexId nearest = m_.tree.nearest(p);
    for (VertexId v : m_.tree.within(p, kAnchorReach * m_.size[nearest]))
      if (may_hold(v, way) && std::find(taken.begin(), taken.end(), v) == taken.end()) return v;
    return {};
  }
  // To start a closed path.
  [[nodiscard]] std::vector<VertexId> starts_near(const Vec3& p, const Way& way) const {
    std::vector<VertexId> starts;
    const VertexId nearest = m_.tree.nearest(p);
    for (VertexId v : m_.tree.within(p, kAnchorReach * m_.size[nearest]))
      if (starts.size() < kStarts && may_hold(v, way)) starts.push_back(v);
    return starts;
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

  // False: there is none.
  bool take_path(const std::vector<std::int32_t>& path) {
    for (std::int32_t e : path) {
      const SkinEdge& edge = m_.skin.edges()[static_cast<std::size_t>(e)];
      take(edge.a);
      take(edge.b);
    }
    return take_edges(path);
  }
  bool take_edges(const std::vector<std::int32_t>& path) {
    for (std::int32_t e : path) {
      m_.route_of_edge[static_cast<std::size_t>(e)] = r_;
      m_.path[static_cast<std::size_t>(r_)].push_back(e);
    }
    return !path.empty();
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

  void begin(std::int32_t r) {
    r_ = r;
    ++route_epoch_;
    hint_ = -1;
    evicted_.clear();
    undo_.clear();
    held_.clear();
    arcs_.assign(1, 0.0);
    for (std::size_t i = 0; i + 1 < route().points.size(); ++i)
      arcs_.push_back(arcs_.back() + (route().points[i + 1] - route().points[i]).norm());
    end_offset_ = {};
    for (const std::size_t which : {0, 1})
      if (const VertexId v = m_.ports[static_cast<std::size_t>(r)][which].vertex; v.valid())
        end_offset_[which] = (m_.mesh.position[v] - (which == 0 ? route().points.front() : route().points.back())).norm();
  }

  // All pieces or nothing; a piece whose path cuts short is halved. Who was moved aside is in evicted_ (also after a failure, which
  // gives their places back).
  bool attempt(std::int32_t r, const Way& way) {
    begin(r);
    if (route().closed) return take_path(closed_path(way));
    const auto& [first, last] = m_.ports[static_cast<std::size_t>(r)];
    if (!first.vertex.valid() || !last.vertex.valid()) return false;
    std::vector<Piece> todo = {{first, last, 0, route().length}};
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
      take_path(*found);
    }
    return true;
  }

  // Corners may have more curves than their vertex has edges. A curve that found no way from end to end shares the first edges of
  // another's path. Nobody is moved aside any more: who is shared with stays.
  void join_others() {
    for (std::size_t r = 0; r < m_.plan.routes.size(); ++r) {
      const auto& [first, last] = m_.ports[r];
      if (!m_.path[r].empty() || m_.plan.routes[r].closed || !first.vertex.valid() || !last.vertex.valid()) continue;
      begin(static_cast<std::int32_t>(r));
      const auto found = shortest_between(branches(first.vertex), branches(last.vertex), {kWideReach, true, false});
      if (!found || path_length(*found) < kShortcut * route().length) continue;
      for (std::size_t i = 0; i + 1 < found->size(); ++i) {  // all vertices but the first and the last
        const SkinEdge &a = m_.skin.edges()[static_cast<std::size_t>((*found)[i])],
                       &b = m_.skin.edges()[static_cast<std::size_t>((*found)[i + 1])];
        take(a.a == b.a || a.a == b.b ? a.a : a.b);
      }
      take_edges(*found);
    }
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
  std::vector<int> fights_;  // per route
  std::uint32_t epoch_ = 0, route_epoch_ = 0;
  std::int32_t r_ = -1, hint_ = -1;
  std::array<double, 2> end_offset_{};  // of the route at hand: from each corner to its vertex
  std::vector<double> arcs_;  // of the route at hand: length up to each of its points
  std::vector<std::int32_t> evicted_;
  std::vector<std::pair<std::int32_t, std::vector<std::int32_t>>> undo_;  // who was moved aside, and the paths they had
  std::vector<VertexId> held_;  // by the attempt under way
};

}  // namespace

void route_paths(Matching& m, Context& context) { Router(m).run(context); }

}  // namespace strata
