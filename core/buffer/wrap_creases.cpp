// Legend: the path of a crease is p0 p1 ... pn; p1 ... pn-1 are its inner vertices. Quads that touch an inner vertex fall into two sides:
// round an inner vertex, quads are on the same side when no edge of the path parts them. S are the hexes behind the quads of one side.
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

constexpr int kMostRounds = 64;  // of rows that touch one another; each takes at least one side off the list

// One side of a crease that bends: a row along it is wanted.
struct Side {
  CurveId crease;
  std::vector<QuadId> quads;   // ascending
};

// Which curve an edge of the skin lies on, if any: both ends are held by it, or by corners at its ends.
class OnCurve {
 public:
  OnCurve(const HexMesh& mesh, const Features& features) : mesh_(mesh), features_(features) {}

  [[nodiscard]] CurveId of(VertexId a, VertexId b) const {
    const Attachment &x = mesh_.attachment[a], &y = mesh_.attachment[b];
    if (x.hold == Hold::Curve && (holds(y, CurveId(x.of)))) return CurveId(x.of);
    if (y.hold == Hold::Curve && (holds(x, CurveId(y.of)))) return CurveId(y.of);
    return {};
  }

 private:
  [[nodiscard]] bool holds(const Attachment& at, CurveId curve) const {
    if (at.hold == Hold::Curve) return at.of == curve.value;
    if (at.hold != Hold::Corner || at.of < 0 || static_cast<std::size_t>(at.of) >= features_.corners.size()) return false;
    const std::vector<CurveId>& curves = features_.corners[CornerId(at.of)].curves;
    return std::find(curves.begin(), curves.end(), curve) != curves.end();
  }

  const HexMesh& mesh_;
  const Features& features_;
};

struct CreaseQuad {
  CurveId crease;
  QuadId quad;
  friend auto operator<=>(const CreaseQuad&, const CreaseQuad&) = default;
};

class SideFinder {
 public:
  SideFinder(const HexMesh& mesh, const Features& features)
      : mesh_(mesh), features_(features), on_(mesh, features), round_(quads_round_vertices(mesh)) {}

  // Every side with a bend, by crease and smallest quad.
  [[nodiscard]] std::vector<Side> run() const {
    std::vector<CreaseQuad> touching;
    for (QuadId q : mesh_.quads.ids())
      for (VertexId v : mesh_.quads[q])
        if (const CurveId c = crease_through(v); c.valid()) touching.push_back({c, q});
    std::sort(touching.begin(), touching.end());
    touching.erase(std::unique(touching.begin(), touching.end()), touching.end());
    std::vector<Side> sides;
    for (std::size_t i = 0; i < touching.size();) {
      std::size_t stop = i;
      std::vector<QuadId> quads;
      for (; stop < touching.size() && touching[stop].crease == touching[i].crease; ++stop) quads.push_back(touching[stop].quad);
      split(touching[i].crease, quads, sides);
      i = stop;
    }
    return sides;
  }

 private:
  // The crease whose inner vertex v is.
  [[nodiscard]] CurveId crease_through(VertexId v) const {
    const Attachment at = mesh_.attachment[v];
    if (at.hold != Hold::Curve) return {};
    const auto quads = round_.of(v);
    const ChartId chart = quads.empty() ? ChartId() : mesh_.chart[quads.front()];
    const bool one_chart = std::all_of(quads.begin(), quads.end(), [&](QuadId q) { return mesh_.chart[q] == chart; });
    return one_chart && chart.valid() ? CurveId(at.of) : CurveId();
  }

  void split(CurveId crease, const std::vector<QuadId>& quads, std::vector<Side>& sides) const {
    std::vector<std::size_t> parent(quads.size());
    std::iota(parent.begin(), parent.end(), std::size_t{0});
    const auto root = [&](std::size_t i) {
      while (parent[i] != i) i = parent[i];
      return i;
    };
    std::vector<char> bends(quads.size(), 0);
    for (std::size_t i = 0; i < quads.size(); ++i) {
      const QuadVertices& q = mesh_.quads[quads[i]];
      int edges = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        const VertexId a = q[k], b = q[(k + 1) & 3];
        if (on_.of(a, b) == crease) {
          ++edges;
          continue;
        }
        if (crease_through(a) != crease && crease_through(b) != crease) continue;
        for (QuadId other : round_.of(a)) {
          if (other == quads[i] || !has_edge(mesh_.quads[other], a, b)) continue;
          const auto at = std::lower_bound(quads.begin(), quads.end(), other);
          if (at == quads.end() || *at != other) continue;
          const std::size_t x = root(i), y = root(static_cast<std::size_t>(at - quads.begin()));
          parent[std::max(x, y)] = std::min(x, y);
        }
      }
      bends[i] = edges > 1;
    }
    for (std::size_t r = 0; r < quads.size(); ++r) {
      if (root(r) != r) continue;
      Side side{crease, {}};
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
  const Features& features_;
  OnCurve on_;
  VertexStars<QuadId> round_;
};

// Sides whose hexes share no vertex can be wrapped at once, first come first served. `tried` are left out.
struct Batch {
  SheetRequest request;
  std::vector<const Side*> sides;
};
Batch choose_batch(const HexMesh& mesh, const std::vector<Side>& sides, const std::vector<std::pair<CurveId, QuadId>>& tried) {
  Batch batch;
  batch.request.strip = StripTakes::Inner;
  batch.request.inner.assign(mesh.hexes.size(), 0);
  const IdMap<QuadId, QuadSides> behind = quad_sides(mesh);
  IdMap<VertexId, std::uint8_t> taken(mesh.position.size(), 0);
  std::vector<HexId> hexes;
  for (const Side& side : sides) {
    if (std::binary_search(tried.begin(), tried.end(), std::pair(side.crease, side.quads.front()))) continue;
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
  diagnostic.message = "no row of hexes beside " + std::to_string(sides) + " sides of creases: it would pinch the mesh";
  diagnostic.count = static_cast<std::int64_t>(sides);
  context.adjusted(std::move(diagnostic));
}

}  // namespace

HexMesh wrap_creases(HexMesh mesh, const Features& features, Context& context) {
  std::vector<std::pair<CurveId, QuadId>> tried;  // sides that would pinch; quads keep their ids when sheets are inserted
  for (int round = 0; round < kMostRounds; ++round) {
    context.checkpoint();
    const std::vector<Side> sides = SideFinder(mesh, features).run();
    Batch batch = choose_batch(mesh, sides, tried);
    if (batch.sides.empty()) break;
    batch.request.faces = faces_between(mesh, batch.request.inner);
    if (const auto pinched = pinched_vertices(mesh, batch.request); !pinched.empty()) {
      for (const Side* side : batch.sides)
        if (touches(mesh, *side, pinched)) tried.emplace_back(side->crease, side->quads.front());
      std::sort(tried.begin(), tried.end());
      continue;
    }
    mesh = insert_row(std::move(mesh), batch.request, features);
  }
  report(tried.size(), context);
  return mesh;
}

}  // namespace strata
