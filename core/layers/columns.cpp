#include "core/layers/columns.h"

#include <algorithm>
#include <limits>

#include "core/mesh/adjacency.h"

namespace strata {
namespace {

bool repeats(const HexVertices& hex) {
  for (std::size_t i = 0; i < 4; ++i)
    if (hex[i] == hex[i + 4]) return true;
  return false;
}

bool joins(const Curve& curve, ChartId a, ChartId b) {
  return (curve.left == a && curve.right == b) || (curve.left == b && curve.right == a);
}

// The curve's direction where it leaves the corner.
Vec3 leaving(const Features& features, const Surface& surface, CurveId c, CornerId corner) {
  const Curve& curve = features.curves[c];
  if (curve.points.size() < 2) return Vec3::Zero();
  const bool forward = curve.first == corner;
  const PointId from = forward ? curve.points.front() : curve.points.back();
  const PointId to = forward ? curve.points[1] : curve.points[curve.points.size() - 2];
  return (surface.points[to] - surface.points[from]).normalized();
}

}  // namespace

std::int32_t Columns::find(VertexId v) const {
  const auto at = std::lower_bound(bottom.begin(), bottom.end(), v);
  return at != bottom.end() && *at == v ? static_cast<std::int32_t>(at - bottom.begin()) : -1;
}

Columns columns_of_sheet(const HexMesh& mesh, HexId first, std::size_t count) {
  IdMap<VertexId, VertexId> top(mesh.position.size());
  for (std::size_t k = 0; k < count; ++k) {
    const HexVertices& hex = mesh.hexes[HexId(first.index() + k)];
    for (std::size_t i = 0; i < 4; ++i) top[hex[i]] = hex[i + 4];
  }
  // A sheet spreads through later sheets only, one strip of hexes at a time.
  for (bool grown = true; grown;) {
    grown = false;
    for (std::size_t h = first.index() + count; h < mesh.hexes.size(); ++h) {
      const HexVertices& hex = mesh.hexes[HexId(h)];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        int up = 0, down = 0;
        for (std::size_t e = 0; e < 4; ++e) {
          const auto& edge = kHexEdges[axis * 4 + e];
          const VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
          up += top[a] == b, down += top[b] == a;
        }
        if (up + down == 0 || up == 4 || down == 4) continue;
        for (std::size_t e = 0; e < 4; ++e) {
          const auto& edge = kHexEdges[axis * 4 + e];
          VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
          if (down > up) std::swap(a, b);
          if (top[a] != b) top[a] = b, grown = true;
        }
      }
    }
  }
  // Old ends of columns that a later sheet moved away belong to no hex any more.
  Columns columns;
  for (VertexId v : top.ids())
    if (top[v].valid()) columns.bottom.push_back(v), columns.top.push_back(top[v]);
  return columns;
}

Collapsed collapse_columns(HexMesh mesh, const std::vector<Vanishing>& sheets) {
  IdMap<VertexId, VertexId> to(mesh.position.size());
  for (VertexId v : to.ids()) to[v] = v;
  for (const Vanishing& sheet : sheets)
    for (VertexId v : *sheet.bottoms)
      if (const std::int32_t c = sheet.columns->find(v); c >= 0) to[sheet.columns->top[static_cast<std::size_t>(c)]] = v;
  for (VertexId v : to.ids())
    while (to[to[v]] != to[v]) to[v] = to[to[v]];
  Collapsed result;
  result.prisms.resize(sheets.size());
  HexMesh& out = result.mesh;
  out.position = std::move(mesh.position);
  out.attachment = std::move(mesh.attachment);
  for (HexId h : mesh.hexes.ids()) {
    HexVertices hex = mesh.hexes[h];
    for (VertexId& v : hex) v = to[v];
    if (!repeats(hex)) {
      out.hexes.push_back(hex);
      out.region.push_back(mesh.region[h]);
      out.layer.push_back(mesh.layer[h]);
      continue;
    }
    for (std::size_t s = 0; s < sheets.size(); ++s) {
      const std::int32_t c = sheets[s].columns->find(mesh.hexes[h][0]);
      if (c < 0 || sheets[s].columns->top[static_cast<std::size_t>(c)] != mesh.hexes[h][4]) continue;
      result.prisms[s].hexes.push_back(hex);
      result.prisms[s].region.push_back(mesh.region[h]);
      break;
    }
  }
  for (QuadId q : mesh.quads.ids()) {
    QuadVertices quad = mesh.quads[q];
    for (VertexId& v : quad) v = to[v];
    if (quad[0] == quad[1] || quad[1] == quad[2] || quad[2] == quad[3] || quad[3] == quad[0]) continue;
    out.quads.push_back(quad);
    out.patch.push_back(mesh.patch[q]);
    out.chart.push_back(mesh.chart[q]);
  }
  return result;
}

void attach_copies(HexMesh& mesh, const IdMap<VertexId, VertexId>& inner_copy, const IdMap<VertexId, Vec3>& direction,
                   const Ground& ground) {
  const VertexStars<QuadId> stars = quads_round_vertices(mesh);
  const Features& features = ground.features();
  for (VertexId v : inner_copy.ids()) {
    const VertexId copy = inner_copy[v];
    if (!copy.valid()) continue;
    const Attachment before = mesh.attachment[v];
    std::vector<ChartId> charts;
    bool labelled = true;
    for (QuadId q : stars.of(copy)) {
      charts.push_back(mesh.chart[q]);
      labelled = labelled && mesh.chart[q].valid();
    }
    std::sort(charts.begin(), charts.end());
    charts.erase(std::unique(charts.begin(), charts.end()), charts.end());
    Attachment& now = mesh.attachment[copy];
    if (charts.empty()) {
      now = {};
      continue;
    }
    if (!labelled) {
      now = {Hold::Chart, kWholeSurface};
      continue;
    }
    now = {Hold::Chart, charts.front().value};
    if (charts.size() == 1) continue;
    const auto within = [&](CurveId c) {
      const Curve& curve = features.curves[c];
      if (charts.size() == 2) return joins(curve, charts[0], charts[1]);
      return std::binary_search(charts.begin(), charts.end(), curve.left) && std::binary_search(charts.begin(), charts.end(), curve.right);
    };
    if (before.hold == Hold::Curve && within(CurveId(before.of))) {
      now = before;
    } else if (before.hold == Hold::Corner) {
      double best = -std::numeric_limits<double>::infinity();
      const CornerId corner(before.of);
      for (CurveId c : features.corners[corner].curves)
        if (within(c))
          if (const double fit = leaving(features, ground.surface(), c, corner).dot(direction[v]); fit > best)
            best = fit, now = {Hold::Curve, c.value};
    }
  }
}

std::size_t tip_of(const HexVertices& prism) {
  for (std::size_t i = 0; i < 4; ++i)
    if (prism[i] == prism[i + 4] && prism[(i + 1) & 3] == prism[((i + 1) & 3) + 4]) return i;
  return 0;
}

}  // namespace strata
