#include "core/buffer/chart_borders.h"

#include <algorithm>

#include "core/base/parallel.h"

namespace strata {
namespace {

constexpr double kWidestCorner = 2.4;  // radians that one quad can have at a corner: beyond 137 degrees two with half of it each are better

struct QuadEdge {
  VertexId a, b;
  QuadId quad;
  std::int8_t edge;
};

std::vector<QuadEdge> sorted_edges(const HexMesh& mesh) {
  std::vector<QuadEdge> edges(mesh.quads.size() * 4);
  parallel_for(mesh.quads.size(), [&](std::size_t i) {
    const QuadVertices& q = mesh.quads[QuadId(i)];
    for (std::size_t j = 0; j < 4; ++j) {
      const VertexId a = q[j], b = q[(j + 1) & 3];
      edges[4 * i + j] = {std::min(a, b), std::max(a, b), QuadId(i), static_cast<std::int8_t>(j)};
    }
  });
  parallel_sort(edges.begin(), edges.end(), [](const QuadEdge& l, const QuadEdge& r) {
    if (l.a != r.a) return l.a < r.a;
    if (l.b != r.b) return l.b < r.b;
    return l.quad < r.quad;
  });
  return edges;
}

// At a corner of more than three charts an outer strip would have to touch two of them at once.
void mark_crowded_corners(const HexMesh& mesh, IdMap<ChartId, std::uint8_t>& tangled) {
  const VertexStars<QuadId> round = quads_round_vertices(mesh);
  std::vector<ChartId> charts;
  for (VertexId v : mesh.position.ids()) {
    if (mesh.attachment[v].hold != Hold::Corner) continue;
    charts.clear();
    for (QuadId q : round.of(v))
      if (std::find(charts.begin(), charts.end(), mesh.chart[q]) == charts.end()) charts.push_back(mesh.chart[q]);
    if (charts.size() < 4) continue;
    for (ChartId c : charts) tangled[c] = 1;
  }
}

}  // namespace

ChartBorders chart_borders(const HexMesh& mesh, std::size_t chart_count) {
  ChartBorders borders;
  borders.across.resize(mesh.quads.size());
  borders.tangled.assign(chart_count, 0);
  const std::vector<QuadEdge> edges = sorted_edges(mesh);
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t stop = i + 1;
    while (stop < edges.size() && edges[stop].a == edges[i].a && edges[stop].b == edges[i].b) ++stop;
    for (std::size_t j = i; j < stop; ++j) {
      const ChartId own = mesh.chart[edges[j].quad];
      ChartId other = own;
      for (std::size_t k = i; k < stop && other == own; ++k) other = mesh.chart[edges[k].quad];
      borders.across[edges[j].quad][static_cast<std::size_t>(edges[j].edge)] = other;
      if (other != own && stop - i > 2) borders.tangled[own] = 1;
    }
    i = stop;
  }
  mark_crowded_corners(mesh, borders.tangled);
  return borders;
}

std::vector<BorderConflict> border_conflicts(const HexMesh& mesh, const ChartBorders& borders, const Features& features) {
  const auto too_wide = [&](std::int32_t corner, ChartId chart) {
    return corner >= 0 && static_cast<std::size_t>(corner) < features.corners.size() &&
           features.corners[CornerId(corner)].angle_of(chart) > kWidestCorner;
  };
  std::vector<BorderConflict> conflicts;
  for (QuadId q : mesh.quads.ids()) {
    const ChartId own = mesh.chart[q];
    const auto& across = borders.across[q];
    for (std::size_t i = 0; i < 4; ++i) {
      if (across[i] == own) continue;
      const std::size_t next = (i + 1) & 3, opposite = (i + 2) & 3;
      if (across[next] != own) {
        const Attachment between = mesh.attachment[mesh.quads[q][next]];
        const bool wide = between.hold == Hold::Corner && too_wide(between.of, own);
        if (between.hold != Hold::Corner || wide) conflicts.push_back({q, own, across[i], across[next], wide});
      }
      if (i < 2 && across[opposite] != own) conflicts.push_back({q, own, across[i], across[opposite]});
    }
  }
  return conflicts;
}

}  // namespace strata
