// Reads downwards: edges, charts, corners, curves.
#include "core/features/features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/features/feature_edges.h"

namespace strata {
namespace {

constexpr double kCornerTurn = std::numbers::pi / 4;    // a curve that turns by more has a corner there
constexpr int kArm = 2;                                 // edges either way over which it must do so: zigzags do not
constexpr double kTipDefect = std::numbers::pi / 3;     // angle missing around a cone tip

// The feature edges at every point, in edge order.
struct FeatureGraph {
  std::vector<FeatureEdge> edges;
  std::vector<std::int32_t> first;     // per point: where its edges begin in `at`; one more entry at the end
  std::vector<std::int32_t> at;

  [[nodiscard]] std::int32_t valence(PointId p) const { return first[p.index() + 1] - first[p.index()]; }
  [[nodiscard]] std::int32_t edge(PointId p, std::int32_t i) const { return at[static_cast<std::size_t>(first[p.index()] + i)]; }
  [[nodiscard]] PointId other(std::int32_t e, PointId p) const {
    const FeatureEdge& edge = edges[static_cast<std::size_t>(e)];
    return edge.low == p ? edge.high : edge.low;
  }
  // The edge that follows e through p, where exactly two meet.
  [[nodiscard]] std::int32_t next(std::int32_t e, PointId p) const { return edge(p, 0) == e ? edge(p, 1) : edge(p, 0); }
};

FeatureGraph make_graph(std::vector<FeatureEdge> edges, std::size_t points) {
  FeatureGraph graph;
  graph.edges = std::move(edges);
  graph.first.assign(points + 1, 0);
  for (const FeatureEdge& e : graph.edges) {
    ++graph.first[e.low.index()];
    ++graph.first[e.high.index()];
  }
  graph.at.resize(static_cast<std::size_t>(exclusive_scan(graph.first)));
  std::vector<std::int32_t> fill = graph.first;
  for (std::size_t e = 0; e < graph.edges.size(); ++e)
    for (const PointId p : {graph.edges[e].low, graph.edges[e].high})
      graph.at[static_cast<std::size_t>(fill[p.index()]++)] = static_cast<std::int32_t>(e);
  return graph;
}

// Flood fill over triangles; feature edges are walls.
void fill_charts(const Surface& surface, const FeatureGraph& graph, Features& features) {
  IdMap<TriangleId, std::array<char, 3>> wall(surface.triangles.size(), std::array<char, 3>{0, 0, 0});
  for (const FeatureEdge& e : graph.edges)
    for (const TriangleId t : {e.forward, e.backward}) {
      if (!t.valid()) continue;
      for (std::size_t i = 0; i < 3; ++i) {
        const PointId a = surface.triangles[t][i], b = surface.triangles[t][(i + 1) % 3];
        if (std::minmax(a, b) == std::minmax(e.low, e.high)) wall[t][i] = 1;
      }
    }
  features.chart.assign(surface.triangles.size(), ChartId());
  std::vector<TriangleId> open;
  for (const TriangleId seed : surface.triangles.ids()) {
    if (features.chart[seed].valid()) continue;
    const ChartId chart = features.patch_of_chart.push_back(surface.patch[seed]);
    features.chart[seed] = chart;
    open.assign(1, seed);
    while (!open.empty()) {
      const TriangleId t = open.back();
      open.pop_back();
      for (std::size_t i = 0; i < 3; ++i) {
        const TriangleId n = surface.neighbours[t][i];
        if (!n.valid() || wall[t][i] || features.chart[n].valid()) continue;
        features.chart[n] = chart;
        open.push_back(n);
      }
    }
  }
}

// The point up to `edges` feature edges away from p, starting along e; stops where the way forks, ends or returns.
PointId walk(const FeatureGraph& graph, PointId p, std::int32_t e, int edges) {
  const PointId start = p;
  for (int i = 0; i < edges; ++i) {
    p = graph.other(e, p);
    if (p == start || graph.valence(p) != 2) break;
    e = graph.next(e, p);
  }
  return p;
}

bool turns(const Surface& surface, const FeatureGraph& graph, PointId p, int arm) {
  const Vec3 to = surface.points[walk(graph, p, graph.edge(p, 0), arm)] - surface.points[p];
  const Vec3 from = surface.points[p] - surface.points[walk(graph, p, graph.edge(p, 1), arm)];
  return std::atan2(from.cross(to).norm(), from.dot(to)) > kCornerTurn;
}

bool is_corner(const Surface& surface, const FeatureGraph& graph, PointId p) {
  if (graph.valence(p) != 2) return graph.valence(p) != 0;
  const FeatureEdge &a = graph.edges[static_cast<std::size_t>(graph.edge(p, 0))],
                    &b = graph.edges[static_cast<std::size_t>(graph.edge(p, 1))];
  if (a.count != b.count) return true;
  return turns(surface, graph, p, 1) && turns(surface, graph, p, kArm);
}

double angle_at(const std::array<Vec3, 3>& corners, std::size_t i) {
  const Vec3 u = corners[(i + 1) % 3] - corners[i], v = corners[(i + 2) % 3] - corners[i];
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

void measure_corners(const Surface& surface, const std::vector<CornerId>& corner_at, Features& features) {
  for (const TriangleId t : surface.triangles.ids())
    for (std::size_t i = 0; i < 3; ++i) {
      const CornerId c = corner_at[surface.triangles[t][i].index()];
      if (!c.valid()) continue;
      std::vector<ChartAngle>& charts = features.corners[c].charts;
      auto at = std::lower_bound(charts.begin(), charts.end(), features.chart[t],
                                 [](const ChartAngle& a, ChartId chart) { return a.chart < chart; });
      if (at == charts.end() || at->chart != features.chart[t]) at = charts.insert(at, {features.chart[t], 0});
      at->angle += angle_at(surface.corners(t), i);
    }
}

// Where a ridge that is to be rounded meets a curve, the curve is rounded as well.
void find_corners(const Surface& surface, const FeatureGraph& graph, const std::vector<char>& on_rounded, std::vector<CornerId>& corner_at,
                  Features& features) {
  std::vector<double> missing(surface.points.size(), 2 * std::numbers::pi);
  for (const TriangleId t : surface.triangles.ids())
    for (std::size_t i = 0; i < 3; ++i) missing[surface.triangles[t][i].index()] -= angle_at(surface.corners(t), i);
  for (const TriangleId t : surface.triangles.ids())
    for (std::size_t i = 0; i < 3; ++i)
      if (!surface.neighbours[t][i].valid())  // what is missing round a border is no tip
        for (const std::size_t end : {i, (i + 1) % 3}) missing[surface.triangles[t][end].index()] = 0;
  corner_at.assign(surface.points.size(), CornerId());
  for (const PointId p : surface.points.ids())
    if ((is_corner(surface, graph, p) && !(on_rounded[p.index()] && graph.valence(p) == 2)) ||
        (graph.valence(p) == 0 && missing[p.index()] > kTipDefect))
      corner_at[p.index()] = features.corners.push_back({p, {}, {}});
  measure_corners(surface, corner_at, features);
}

void measure(const FeatureGraph& graph, const std::vector<std::int32_t>& chain, Curve& curve) {
  double weighted = 0;
  curve.dihedral_min = 2 * std::numbers::pi;
  curve.dihedral_max = 0;
  for (const std::int32_t i : chain) {
    const FeatureEdge& e = graph.edges[static_cast<std::size_t>(i)];
    const double dihedral = std::numbers::pi - e.turn;
    curve.length += e.length;
    weighted += e.length * dihedral;
    curve.dihedral_min = std::min(curve.dihedral_min, dihedral);
    curve.dihedral_max = std::max(curve.dihedral_max, dihedral);
    curve.manifold = curve.manifold && e.count == 2;
  }
  curve.dihedral_mean = weighted / curve.length;
}

// Follows the curve from p along e until the next corner or back to p.
void trace(const FeatureGraph& graph, PointId p, std::int32_t e, const std::vector<CornerId>& corner_at, std::vector<char>& done,
           Features& features) {
  Curve curve;
  std::vector<std::int32_t> chain;
  const PointId start = p;
  const std::int32_t first_edge = e;
  for (;;) {
    curve.points.push_back(p);
    chain.push_back(e);
    done[static_cast<std::size_t>(e)] = 1;
    p = graph.other(e, p);
    if (p == start || corner_at[p.index()].valid()) break;
    e = graph.next(e, p);
  }
  curve.closed = p == start;
  if (!curve.closed) curve.points.push_back(p);
  curve.first = corner_at[start.index()];
  curve.last = corner_at[p.index()];
  measure(graph, chain, curve);

  const FeatureEdge& edge = graph.edges[static_cast<std::size_t>(first_edge)];
  const bool along = edge.low == start;
  const TriangleId left = along ? edge.forward : edge.backward, right = along ? edge.backward : edge.forward;
  if (left.valid()) curve.left = features.chart[left];
  if (right.valid()) curve.right = features.chart[right];
  if (!curve.left.valid()) {
    // A border is kept on the left.
    std::swap(curve.left, curve.right);
    std::swap(curve.first, curve.last);
    std::reverse(curve.points.begin() + (curve.closed ? 1 : 0), curve.points.end());
  }
  const CornerId first = curve.first, last = curve.last;
  const CurveId id = features.curves.push_back(std::move(curve));
  if (first.valid()) features.corners[first].curves.push_back(id);
  if (last.valid()) features.corners[last].curves.push_back(id);
}

}  // namespace

Features detect_features(const Surface& surface, const FeatureOptions& options, Context& context) {
  const std::vector<FeatureEdge> edges = all_edges(surface);
  const std::vector<EdgeMark> mark = mark_features(surface, edges, options);
  context.progress(0.5);
  Features features;
  std::vector<FeatureEdge> chosen;
  std::vector<char> on_rounded(surface.points.size(), 0);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (mark[e] == EdgeMark::Feature) chosen.push_back(edges[e]);
    if (mark[e] != EdgeMark::Rounded) continue;
    features.rounded.length += edges[e].length;
    features.rounded.sharpest = std::min(features.rounded.sharpest, std::numbers::pi - std::abs(edges[e].turn));
    for (const PointId p : {edges[e].low, edges[e].high}) features.rounded.box.add(surface.points[p]), on_rounded[p.index()] = 1;
  }
  const FeatureGraph graph = make_graph(std::move(chosen), surface.points.size());

  fill_charts(surface, graph, features);
  std::vector<CornerId> corner_at;
  find_corners(surface, graph, on_rounded, corner_at, features);
  std::vector<char> done(graph.edges.size(), 0);
  for (const CornerId c : features.corners.ids()) {
    const PointId p = features.corners[c].point;
    for (std::int32_t i = 0; i < graph.valence(p); ++i)
      if (!done[static_cast<std::size_t>(graph.edge(p, i))]) trace(graph, p, graph.edge(p, i), corner_at, done, features);
  }
  for (std::size_t e = 0; e < graph.edges.size(); ++e)
    if (!done[e]) trace(graph, graph.edges[e].low, static_cast<std::int32_t>(e), corner_at, done, features);
  context.progress(1);
  return features;
}

}  // namespace strata
