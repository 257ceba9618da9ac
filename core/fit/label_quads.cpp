// Regions between paths become charts; charts that only softened curves separate share a region and are one from here on, patches apart.
#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/base/parallel.h"
#include "core/fit/matching.h"
#include "core/fit/openings.h"

namespace strata {
namespace {

constexpr double kAtHome = 0.5;      // of a chart's area in one region: less only strays there
constexpr int kSmoothSweeps = 4;

// Connected quads between paths, named by their smallest quad.
IdMap<QuadId, std::int32_t> flood(const Matching& m) {
  IdMap<QuadId, std::int32_t> parent(m.mesh.quads.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t q) {
    while (parent[QuadId(q)] != q) q = parent[QuadId(q)] = parent[QuadId(parent[QuadId(q)])];
    return q;
  };
  for (std::size_t e = 0; e < m.skin.edges().size(); ++e) {
    const SkinEdge& edge = m.skin.edges()[e];
    if (edge.count != 2 || m.route_of_edge[e] >= 0) continue;
    const auto quads = m.skin.quads_of(edge);
    const std::int32_t a = root(quads[0].value), b = root(quads[1].value);
    parent[QuadId(std::max(a, b))] = std::min(a, b);
  }
  for (QuadId q : parent.ids()) parent[q] = root(q.value);
  return parent;
}

// Charts that no path separates, named by their smallest.
IdMap<ChartId, ChartId> joined_charts(const Matching& m) {
  const Features& features = m.ground.features();
  IdMap<ChartId, ChartId> parent(features.chart_count());
  for (ChartId c : parent.ids()) parent[c] = c;
  const auto root = [&](ChartId c) {
    while (parent[c] != c) c = parent[c];
    return c;
  };
  IdMap<CurveId, std::uint8_t> held(features.curves.size(), std::uint8_t{0});
  for (std::size_t r = 0; r < m.plan.routes.size(); ++r)
    if (!m.path[r].empty())
      for (CurveId c : m.plan.routes[r].curves) held[c] = 1;
  for (CurveId c : features.curves.ids()) {
    const ChartId left = features.curves[c].left, right = features.curves[c].right;
    if (held[c] || m.plan.contracted[c] || !left.valid() || !right.valid()) continue;
    const ChartId a = root(left), b = root(right);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (ChartId c : parent.ids()) parent[c] = root(c);
  return parent;
}

// Shells by their smallest chart: charts that have a point of the surface in common are of one shell.
IdMap<ChartId, ChartId> shells(const Surface& surface, const Features& features) {
  IdMap<ChartId, ChartId> parent(features.chart_count());
  for (ChartId c : parent.ids()) parent[c] = c;
  const auto root = [&](ChartId c) {
    while (parent[c] != c) c = parent[c] = parent[parent[c]];
    return c;
  };
  IdMap<PointId, ChartId> at(surface.points.size());
  for (TriangleId t : surface.triangles.ids()) {
    if (!features.chart[t].valid()) continue;
    for (PointId p : surface.triangles[t]) {
      if (!at[p].valid()) at[p] = features.chart[t];
      const ChartId a = root(at[p]), b = root(features.chart[t]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (ChartId c : parent.ids()) parent[c] = root(c);
  return parent;
}

// 1 for charts that the surface ends at.
IdMap<ChartId, std::uint8_t> open_charts(const Surface& surface, const Features& features) {
  IdMap<ChartId, std::uint8_t> open(features.chart_count(), std::uint8_t{0});
  for (TriangleId t : triangles_at_openings(surface))
    if (features.chart[t].valid()) open[features.chart[t]] = 1;
  return open;
}

struct Nearest {
  IdMap<QuadId, ChartId> chart;
  IdMap<QuadId, double> area;
};

// The smallest chart of the same group and patch.
IdMap<ChartId, ChartId> merged_charts(const Features& features, const IdMap<ChartId, ChartId>& group) {
  IdMap<ChartId, ChartId> into(group.size());
  std::vector<ChartId> order(group.size());
  for (ChartId c : group.ids()) order[c.index()] = c;
  const auto key = [&](ChartId c) { return std::tie(group[c], features.patch_of_chart[c]); };
  std::sort(order.begin(), order.end(), [&](ChartId a, ChartId b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  for (std::size_t i = 0; i < order.size(); ++i)
    into[order[i]] = i > 0 && key(order[i]) == key(order[i - 1]) ? into[order[i - 1]] : order[i];
  return into;
}

Nearest nearest_charts(const Matching& m, const HexMesh& mesh, const IdMap<ChartId, ChartId>& into) {
  Nearest nearest{IdMap<QuadId, ChartId>(mesh.quads.size()), IdMap<QuadId, double>(mesh.quads.size())};
  parallel_for(mesh.quads.size(), [&](std::size_t i) {
    const QuadVertices& q = mesh.quads[QuadId(i)];
    const Vec3 &a = mesh.position[q[0]], &b = mesh.position[q[1]], &c = mesh.position[q[2]], &d = mesh.position[q[3]];
    nearest.chart[QuadId(i)] = into[m.ground.features().chart[m.ground.closest(0.25 * (a + b + c + d)).triangle]];
    nearest.area[QuadId(i)] = 0.5 * (c - a).cross(d - b).norm();
  });
  return nearest;
}

// A quad with three or more neighbours of one other patch in its region follows them.
void smooth_patches(const Matching& m, HexMesh& mesh, const IdMap<QuadId, std::uint8_t>& mixed) {
  for (int sweep = 0; sweep < kSmoothSweeps; ++sweep) {
    std::vector<std::pair<QuadId, ChartId>> changes;
    for (QuadId q : mesh.quads.ids()) {
      if (!mixed[q]) continue;
      const QuadVertices& c = mesh.quads[q];
      std::array<int, 4> same{};  // neighbours of the same chart as neighbour k, itself included
      std::array<ChartId, 4> around;
      std::size_t n = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        const std::int32_t e = m.skin.edge_between(c[k], c[(k + 1) & 3]);
        const SkinEdge& edge = m.skin.edges()[static_cast<std::size_t>(e)];
        if (edge.count != 2 || m.route_of_edge[static_cast<std::size_t>(e)] >= 0) continue;
        const auto quads = m.skin.quads_of(edge);
        around[n++] = mesh.chart[quads[0] == q ? quads[1] : quads[0]];
      }
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = 0; k < n; ++k) same[i] += around[i] == around[k];
      const auto most = static_cast<std::size_t>(std::max_element(same.begin(), same.end()) - same.begin());
      if (same[most] >= 3 && around[most] != mesh.chart[q]) changes.emplace_back(q, around[most]);
    }
    for (const auto& [q, chart] : changes) mesh.chart[q] = chart;
    if (changes.empty()) break;
  }
}

void attach(const Matching& m, HexMesh& mesh, const IdMap<QuadId, ChartId>& slides_on) {
  for (VertexId v : m.skin.vertices()) {
    if (m.corner_at[v].valid()) {
      mesh.attachment[v] = {Hold::Corner, m.corner_at[v].value};
      continue;
    }
    if (const std::int32_t r = m.route_at[v]; r >= 0) {
      CurveId best;
      double best_distance = std::numeric_limits<double>::infinity();
      for (CurveId c : m.plan.routes[static_cast<std::size_t>(r)].curves) {
        const double d = (m.ground.project({Hold::Curve, c.value}, mesh.position[v]).position - mesh.position[v]).squaredNorm();
        if (d >= best_distance) continue;
        best_distance = d;
        best = c;
      }
      mesh.attachment[v] = {Hold::Curve, best.value};
      continue;
    }
    if (mesh.attachment[v].hold == Hold::Free) continue;  // over an opening
    ChartId chart;
    bool several = false;
    for (std::int32_t e : m.skin.edges_round(v))
      for (QuadId q : m.skin.quads_of(m.skin.edges()[static_cast<std::size_t>(e)])) {
        several = several || (chart.valid() && slides_on[q] != chart);
        chart = slides_on[q];
      }
    mesh.attachment[v] = {Hold::Chart, several ? kWholeSurface : chart.value};
  }
}

}  // namespace

IdMap<ChartId, ChartId> label_quads(const Matching& m, HexMesh& mesh) {
  const Features& features = m.ground.features();
  const IdMap<ChartId, ChartId> group = joined_charts(m);
  IdMap<ChartId, ChartId> into = merged_charts(features, group);
  const Nearest nearest = nearest_charts(m, mesh, into);
  const IdMap<QuadId, std::int32_t> region = flood(m);
  const IdMap<ChartId, ChartId> shell = shells(m.ground.surface(), features);
  const IdMap<ChartId, std::uint8_t> open = open_charts(m.ground.surface(), features);

  struct Vote {
    std::int32_t region;
    ChartId group, chart;
    QuadId quad;
  };
  std::vector<Vote> votes;
  votes.reserve(mesh.quads.size());
  for (QuadId q : mesh.quads.ids()) votes.push_back({region[q], group[nearest.chart[q]], nearest.chart[q], q});
  parallel_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) {
    return std::tie(a.region, a.group, a.chart, a.quad) < std::tie(b.region, b.group, b.chart, b.quad);
  });
  IdMap<ChartId, double> whole(features.chart_count(), 0.0);
  for (QuadId q : mesh.quads.ids()) whole[nearest.chart[q]] += nearest.area[q];

  mesh.chart.assign(mesh.quads.size(), ChartId());
  mesh.patch.assign(mesh.quads.size(), PatchId());
  IdMap<QuadId, std::uint8_t> mixed(mesh.quads.size(), std::uint8_t{0});
  IdMap<ChartId, double> share(features.chart_count(), 0.0);  // of each chart, in the region at hand
  for (std::size_t i = 0; i < votes.size();) {
    // The group with the largest area has the region; of its charts those that are at home in it show. So do others that came in where there
    // is no curve that could part them: where shells cross, and over an opening.
    std::size_t stop = i;
    double best_area = -1;
    ChartId largest, best_group;
    while (stop < votes.size() && votes[stop].region == votes[i].region) {
      const ChartId g = votes[stop].group;
      double group_area = 0, chart_area = -1;
      ChartId largest_here;
      while (stop < votes.size() && votes[stop].region == votes[i].region && votes[stop].group == g) {
        const Vote& head = votes[stop];
        double area = 0;
        for (; stop < votes.size() && votes[stop].region == head.region && votes[stop].chart == head.chart; ++stop)
          area += nearest.area[votes[stop].quad];
        if (area > chart_area) {
          chart_area = area;
          largest_here = head.chart;
        }
        group_area += area;
        share[head.chart] = area;
      }
      if (group_area > best_area) {
        best_area = group_area;
        best_group = g;
        largest = largest_here;
      }
    }
    bool one_chart = true;
    const auto at_home = [&](const Vote& vote) {
      const bool may_show = vote.group == best_group || shell[vote.chart] != shell[largest] || (open[vote.chart] && open[largest]);
      return may_show && share[vote.chart] > kAtHome * whole[vote.chart];
    };
    for (std::size_t j = i; j < stop; ++j) {
      const ChartId shown = at_home(votes[j]) ? votes[j].chart : largest;
      mesh.chart[votes[j].quad] = shown;
      one_chart = one_chart && shown == largest;
    }
    if (!one_chart)
      for (std::size_t j = i; j < stop; ++j) mixed[votes[j].quad] = 1;
    i = stop;
  }
  const IdMap<QuadId, ChartId> slides_on = mesh.chart;
  smooth_patches(m, mesh, mixed);
  for (QuadId q : mesh.quads.ids()) mesh.patch[q] = features.patch_of_chart[mesh.chart[q]];
  attach(m, mesh, slides_on);
  return into;
}

}  // namespace strata
