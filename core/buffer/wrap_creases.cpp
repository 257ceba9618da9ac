// Legend: the path of a crease is p0 p1 ... pn; p1 ... pn-1 are its inner vertices. Quads that touch an inner vertex fall into two sides:
// round an inner vertex, quads are on the same side when no edge of a path parts them. The path stays with the old vertices, so its edges
// stay what they were. S are the hexes behind the quads of one side.
#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/base/parallel.h"
#include "core/buffer/creases.h"
#include "core/buffer/ridge_rows.h"
#include "core/mesh/adjacency.h"
#include "core/sheets/insert_sheet.h"

namespace strata {
namespace {

constexpr int kMostRounds = 64;  // each takes at least one side off the list; more rows that touch one another are not worth it

// One side of a crease that bends, or of several that meet: a row along it is wanted.
struct Side {
  std::int32_t group;          // of paths
  std::vector<QuadId> quads;   // ascending
};

// The edges of all paths, for questions by edge and by vertex. Two paths that meet inside a chart are one group: rows along one go on along the
// next, where rows of their own would crowd the sector between them with four quads.
class Paths {
 public:
  Paths(const std::vector<CreaseEdge>& edges, const HexMesh& mesh) : edges_(edges), group_at_(mesh.position.size(), -1) {
    std::int32_t paths = 0;
    for (CreaseEdge& e : edges_) {
      if (e.b < e.a) std::swap(e.a, e.b);
      paths = std::max(paths, e.path + 1);
    }
    std::sort(edges_.begin(), edges_.end(), by_edge);
    std::vector<std::pair<VertexId, std::int32_t>> ends;
    for (const CreaseEdge& e : edges_) {
      ends.emplace_back(e.a, e.path);
      ends.emplace_back(e.b, e.path);
    }
    std::sort(ends.begin(), ends.end());
    const IdMap<VertexId, std::uint8_t> on_border = borders_of_charts(mesh);
    group_.resize(static_cast<std::size_t>(paths));
    std::iota(group_.begin(), group_.end(), 0);
    const auto is_inner = [&](std::size_t i) {
      const auto [v, path] = ends[i];
      if (v != ends[i + 1].first) return false;
      const bool two = (i == 0 || ends[i - 1].first != v) && (i + 2 == ends.size() || ends[i + 2].first != v);
      return path == ends[i + 1].second || (two && on_border[v] == 0);
    };
    for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
      if (!is_inner(i)) continue;
      const std::int32_t a = root(ends[i].second), b = root(ends[i + 1].second);
      group_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
    for (std::int32_t& g : group_) g = root(g);
    for (std::size_t i = 0; i + 1 < ends.size(); ++i)
      if (is_inner(i)) group_at_[ends[i].first] = group_[static_cast<std::size_t>(ends[i].second)];
  }
  // -1: on no path.
  [[nodiscard]] std::int32_t of_edge(VertexId a, VertexId b) const {
    const CreaseEdge wanted{-1, std::min(a, b), std::max(a, b)};
    const auto at = std::lower_bound(edges_.begin(), edges_.end(), wanted, by_edge);
    return at != edges_.end() && at->a == wanted.a && at->b == wanted.b ? at->path : -1;
  }
  [[nodiscard]] std::int32_t group(std::int32_t path) const { return path < 0 ? -1 : group_[static_cast<std::size_t>(path)]; }
  // The group of paths whose inner vertex v is, or -1. Vertices made later are on none.
  [[nodiscard]] std::int32_t through(VertexId v) const { return v.index() < group_at_.size() ? group_at_[v] : -1; }

 private:
  static bool by_edge(const CreaseEdge& x, const CreaseEdge& y) { return std::tie(x.a, x.b) < std::tie(y.a, y.b); }
  [[nodiscard]] std::int32_t root(std::int32_t path) const {
    while (group_[static_cast<std::size_t>(path)] != path) path = group_[static_cast<std::size_t>(path)];
    return path;
  }
  static IdMap<VertexId, std::uint8_t> borders_of_charts(const HexMesh& mesh) {
    IdMap<VertexId, ChartId> seen(mesh.position.size());
    IdMap<VertexId, std::uint8_t> border(mesh.position.size(), 0);
    for (QuadId q : mesh.quads.ids())
      for (VertexId v : mesh.quads[q]) {
        if (seen[v].valid() && seen[v] != mesh.chart[q]) border[v] = 1;
        seen[v] = mesh.chart[q];
      }
    return border;
  }

  std::vector<CreaseEdge> edges_;
  std::vector<std::int32_t> group_;  // by path
  IdMap<VertexId, std::int32_t> group_at_;
};

class SideFinder {
 public:
  SideFinder(const HexMesh& mesh, const Paths& paths) : mesh_(mesh), paths_(paths), round_(quads_round_vertices(mesh)) {}

  // Every side with a bend, by group and smallest quad.
  [[nodiscard]] std::vector<Side> run() const {
    std::vector<std::pair<std::int32_t, QuadId>> touching;
    for (QuadId q : mesh_.quads.ids())
      for (VertexId v : mesh_.quads[q])
        if (const std::int32_t group = paths_.through(v); group >= 0) touching.emplace_back(group, q);
    std::sort(touching.begin(), touching.end());
    touching.erase(std::unique(touching.begin(), touching.end()), touching.end());
    std::vector<Side> sides;
    for (std::size_t i = 0; i < touching.size();) {
      std::size_t stop = i;
      std::vector<QuadId> quads;
      for (; stop < touching.size() && touching[stop].first == touching[i].first; ++stop) quads.push_back(touching[stop].second);
      split(touching[i].first, quads, sides);
      i = stop;
    }
    return sides;
  }

 private:
  void split(std::int32_t group, const std::vector<QuadId>& quads, std::vector<Side>& sides) const {
    std::vector<std::size_t> parent(quads.size());
    std::iota(parent.begin(), parent.end(), std::size_t{0});
    const auto root = [&](std::size_t i) {
      while (parent[i] != i) i = parent[i];
      return i;
    };
    const auto index_of = [&](QuadId q) {
      const auto at = std::lower_bound(quads.begin(), quads.end(), q);
      return at != quads.end() && *at == q ? static_cast<std::ptrdiff_t>(at - quads.begin()) : std::ptrdiff_t{-1};
    };
    std::vector<char> bends(quads.size(), 0);
    std::vector<std::pair<std::size_t, std::size_t>> across;  // quads on either side of a path edge
    for (std::size_t i = 0; i < quads.size(); ++i) {
      const QuadVertices& q = mesh_.quads[quads[i]];
      std::array<std::int32_t, 4> on_path{};
      for (std::size_t k = 0; k < 4; ++k) {
        const VertexId a = q[k], b = q[(k + 1) & 3];
        const std::int32_t on = on_path[k] = paths_.of_edge(a, b);
        if (on < 0 && paths_.through(a) != group && paths_.through(b) != group) continue;
        for (QuadId other : round_.of(a)) {
          if (other == quads[i] || !has_edge(mesh_.quads[other], a, b)) continue;
          const std::ptrdiff_t at = index_of(other);
          if (at < 0) continue;
          if (on >= 0) {
            across.emplace_back(i, static_cast<std::size_t>(at));
            continue;
          }
          const std::size_t x = root(i), y = root(static_cast<std::size_t>(at));
          parent[std::max(x, y)] = std::min(x, y);
        }
      }
      for (std::size_t k = 0; k < 4; ++k)
        for (std::size_t j = 0; j < k; ++j)
          if (on_path[k] >= 0 && on_path[k] == on_path[j] && paths_.group(on_path[k]) == group) bends[i] = 1;
    }
    std::vector<char> crossed(quads.size(), 0);  // by root: a path runs through the side itself
    for (const auto& [x, y] : across)
      if (root(x) == root(y)) crossed[root(x)] = 1;
    for (std::size_t r = 0; r < quads.size(); ++r) {
      if (root(r) != r || crossed[r]) continue;
      Side side{group, {}};
      bool bent = false;
      for (std::size_t i = r; i < quads.size(); ++i) {
        if (root(i) != r) continue;
        side.quads.push_back(quads[i]);
        bent = bent || bends[i];
      }
      if (bent) sides.push_back(std::move(side));
    }
  }

  static bool has_edge(const QuadVertices& q, VertexId a, VertexId b) {
    for (std::size_t k = 0; k < 4; ++k)
      if ((q[k] == a && q[(k + 1) & 3] == b) || (q[k] == b && q[(k + 1) & 3] == a)) return true;
    return false;
  }

  const HexMesh& mesh_;
  const Paths& paths_;
  VertexStars<QuadId> round_;
};

// Sides whose hexes share no vertex can be wrapped at once, first come first served. `tried` are left out.
struct Batch {
  SheetRequest request;
  std::vector<const Side*> sides;
};
Batch choose_batch(const HexMesh& mesh, const std::vector<Side>& sides, const std::vector<std::pair<std::int32_t, QuadId>>& tried) {
  Batch batch;
  batch.request.strip = StripTakes::Inner;
  batch.request.inner.assign(mesh.hexes.size(), 0);
  const IdMap<QuadId, QuadSides> behind = quad_sides(mesh);
  IdMap<VertexId, std::uint8_t> taken(mesh.position.size(), 0);
  std::vector<HexId> hexes;
  for (const Side& side : sides) {
    if (std::binary_search(tried.begin(), tried.end(), std::pair(side.group, side.quads.front()))) continue;
    hexes.clear();
    for (QuadId q : side.quads)
      for (HexId h : {behind[q].back, behind[q].front})
        if (h.valid()) hexes.push_back(h);
    const bool clear = std::all_of(hexes.begin(), hexes.end(), [&](HexId h) {
      return std::none_of(mesh.hexes[h].begin(), mesh.hexes[h].end(), [&](VertexId v) { return taken[v] != 0; });
    });
    if (!clear) continue;
    for (HexId h : hexes) {
      batch.request.inner[h] = 1;
      for (VertexId v : mesh.hexes[h]) taken[v] = 1;
    }
    batch.sides.push_back(&side);
  }
  return batch;
}

bool touches(const HexMesh& mesh, const Side& side, const std::vector<VertexId>& vertices) {
  const IdMap<QuadId, QuadSides> behind = quad_sides(mesh);
  for (QuadId q : side.quads)
    for (HexId h : {behind[q].back, behind[q].front})
      if (h.valid())
        for (VertexId v : mesh.hexes[h])
          if (std::binary_search(vertices.begin(), vertices.end(), v)) return true;
  return false;
}

void report(std::size_t sides, Context& context) {
  if (sides == 0) return;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::TopologyChanged;
  diagnostic.severity = Severity::Info;
  diagnostic.message = "no row of hexes, or one with a gap, beside " + std::to_string(sides) + " sides of creases: it would pinch the mesh";
  diagnostic.count = static_cast<std::int64_t>(sides);
  context.adjusted(std::move(diagnostic));
}

}  // namespace

HexMesh wrap_creases(HexMesh mesh, const std::vector<CreaseEdge>& creases, const Features& features, Context& context) {
  const Paths paths(creases, mesh);
  std::vector<std::pair<std::int32_t, QuadId>> tried;  // sides that would pinch; quads keep their ids when sheets are inserted
  for (int round = 0; round < kMostRounds; ++round) {
    context.checkpoint();
    const std::vector<Side> sides = SideFinder(mesh, paths).run();
    Batch batch = choose_batch(mesh, sides, tried);
    if (batch.sides.empty()) break;
    batch.request.faces = faces_between(mesh, batch.request.inner);
    if (const auto pinched = pinched_vertices(mesh, batch.request); !pinched.empty()) {
      for (const Side* side : batch.sides)
        if (touches(mesh, *side, pinched)) tried.emplace_back(side->group, side->quads.front());
      std::sort(tried.begin(), tried.end());
      if (!shrink_from_pinches(mesh, batch.request)) continue;
    }
    mesh = insert_row(std::move(mesh), batch.request, features);
  }
  report(tried.size(), context);
  return mesh;
}

}  // namespace strata
