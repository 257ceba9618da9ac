// Regions between paths become charts; what a softened curve separates shares a region, and there only patches are told apart.
#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/base/parallel.h"
#include "core/fit/matching.h"

namespace strata {
namespace {

constexpr double kStray = 0.02;      // of a region's area may lie on other charts because paths stray from their curves
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
    if (held[c] || !left.valid() || !right.valid()) continue;
    const ChartId a = root(left), b = root(right);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (ChartId c : parent.ids()) parent[c] = root(c);
  return parent;
}

struct Nearest {
  IdMap<QuadId, ChartId> chart;
  IdMap<QuadId, double> area;
};

Nearest nearest_charts(const Matching& m, const HexMesh& mesh) {
  Nearest nearest{IdMap<QuadId, ChartId>(mesh.quads.size()), IdMap<QuadId, double>(mesh.quads.size())};
  parallel_for(mesh.quads.size(), [&](std::size_t i) {
    const QuadVertices& q = mesh.quads[QuadId(i)];
    const Vec3 &a = mesh.position[q[0]], &b = mesh.position[q[1]], &c = mesh.position[q[2]], &d = mesh.position[q[3]];
    nearest.chart[QuadId(i)] = m.ground.features().chart[m.ground.closest(0.25 * (a + b + c + d)).triangle];
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

void label_quads(const Matching& m, HexMesh& mesh) {
  const Features& features = m.ground.features();
  const Nearest nearest = nearest_charts(m, mesh);
  const IdMap<QuadId, std::int32_t> region = flood(m);
  const IdMap<ChartId, ChartId> group = joined_charts(m);

  struct Vote {
    std::int32_t region;
    ChartId group;
    PatchId patch;
    ChartId chart;
    QuadId quad;
  };
  std::vector<Vote> votes;
  votes.reserve(mesh.quads.size());
  for (QuadId q : mesh.quads.ids())
    votes.push_back({region[q], group[nearest.chart[q]], features.patch_of_chart[nearest.chart[q]], nearest.chart[q], q});
  parallel_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) {
    return std::tie(a.region, a.group, a.patch, a.chart, a.quad) < std::tie(b.region, b.group, b.patch, b.chart, b.quad);
  });

  mesh.chart.assign(mesh.quads.size(), ChartId());
  mesh.patch.assign(mesh.quads.size(), PatchId());
  IdMap<QuadId, ChartId> slides_on(mesh.quads.size());           // the chart under a quad where several share its label
  IdMap<QuadId, std::uint8_t> mixed(mesh.quads.size(), std::uint8_t{0});
  struct Share {
    PatchId patch;
    ChartId chart;   // the largest of the patch in the region
    double area = 0, of_chart = 0;
  };
  for (std::size_t i = 0; i < votes.size();) {
    std::size_t stop = i;
    std::vector<Share> shares, best_shares;
    double best_area = -1, whole = 0;
    while (stop < votes.size() && votes[stop].region == votes[i].region) {
      const ChartId g = votes[stop].group;
      double group_area = 0;
      shares.clear();
      for (; stop < votes.size() && votes[stop].region == votes[i].region && votes[stop].group == g;) {
        const Vote& head = votes[stop];
        double area = 0;
        for (; stop < votes.size() && votes[stop].region == head.region && votes[stop].chart == head.chart; ++stop)
          area += nearest.area[votes[stop].quad];
        if (shares.empty() || shares.back().patch != head.patch) shares.push_back({head.patch, head.chart, 0, -1});
        Share& share = shares.back();
        share.area += area;
        if (area > share.of_chart) {
          share.of_chart = area;
          share.chart = head.chart;
        }
        group_area += area;
      }
      whole += group_area;
      if (group_area > best_area) {
        best_area = group_area;
        best_shares = shares;
      }
    }
    const auto largest =
        *std::max_element(best_shares.begin(), best_shares.end(), [](const Share& a, const Share& b) { return a.area < b.area; });
    const bool one_chart = largest.of_chart > (1 - kStray) * best_area;
    const bool one_patch = largest.area > (1 - kStray) * best_area;
    for (; i < stop; ++i) {
      const Vote& vote = votes[i];
      const bool inside = vote.group == group[largest.chart];
      mesh.chart[vote.quad] = largest.chart;
      slides_on[vote.quad] = one_chart || !inside ? largest.chart : vote.chart;
      if (one_patch || !inside) continue;
      mixed[vote.quad] = 1;
      for (const Share& share : best_shares)
        if (share.patch == vote.patch) mesh.chart[vote.quad] = share.chart;
    }
  }
  smooth_patches(m, mesh, mixed);
  for (QuadId q : mesh.quads.ids()) mesh.patch[q] = features.patch_of_chart[mesh.chart[q]];
  attach(m, mesh, slides_on);
}

}  // namespace strata
