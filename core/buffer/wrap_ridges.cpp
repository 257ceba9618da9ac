// Ridge layers. Legend: C is the chart whose hexes S (those with a quad on C) are wrapped; at a vertex v of C's border the sheet makes a
// copy v'. S keeps v', the neighbours keep v, and a strip of quads between v and v' appears on the surface.
//
//   outer strip (the usual)                 inner strip (where C's border is tangled)
//   C C C C v'=ridge  strip  v  D D D       C C C C v'  strip  v=ridge  D D D
//   the strip is D's: D's quads at          the strip is C's: C's quads at
//   the ridge are new                       the ridge are new
#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/buffer/chart_borders.h"
#include "core/buffer/creases.h"
#include "core/buffer/ridge_rows.h"
#include "core/buffer/thicken.h"
#include "core/buffer/wrap.h"
#include "core/mesh/adjacency.h"
#include "core/sheets/insert_sheet.h"

namespace strata {
namespace {

// What has been done about a chart, for each strip rule.
enum class Standing : std::uint8_t { Open, Alone, Wrapped, Skipped };  // Alone: to be tried again by itself
struct Ledger {
  std::array<IdMap<ChartId, Standing>, 2> of;
  Standing& at(StripTakes strip, ChartId c) { return of[strip == StripTakes::Inner ? 0 : 1][c]; }
  bool available(StripTakes strip, ChartId c) { return at(strip, c) == Standing::Open || at(strip, c) == Standing::Alone; }
};

struct Wish {
  ChartId chart;
  StripTakes strip;
  friend bool operator==(const Wish&, const Wish&) = default;
};

// Wrapping the chart across either edge with an outer strip gives the quad's chart a fresh row there; wrapping the quad's own chart
// with an inner strip does too, and asks nothing of the neighbours.
std::optional<Wish> cure(const BorderConflict& conflict, const ChartBorders& borders, Ledger& ledger) {
  // Only a fresh row of its own gives the quad's corner a second quad.
  if (conflict.wide_corner)
    return conflict.own.valid() && ledger.available(StripTakes::Inner, conflict.own) ? std::optional(Wish{conflict.own, StripTakes::Inner})
                                                                                     : std::nullopt;
  const std::array<ChartId, 2> others{std::min(conflict.first, conflict.second), std::max(conflict.first, conflict.second)};
  for (ChartId c : others)
    if (c.valid() && borders.tangled[c] == 0 && ledger.available(StripTakes::Outer, c)) return Wish{c, StripTakes::Outer};
  if (conflict.own.valid() && ledger.available(StripTakes::Inner, conflict.own)) return Wish{conflict.own, StripTakes::Inner};
  return std::nullopt;
}

// Charts that share no vertex can be wrapped at once; the smallest chart's strip rule leads.
std::vector<ChartId> choose_batch(const HexMesh& mesh, const std::vector<Wish>& wishes, Ledger& ledger) {
  const StripTakes strip = wishes.front().strip;
  std::size_t chart_count = 0;
  for (const Wish& w : wishes) chart_count = std::max(chart_count, w.chart.index() + 1);
  IdMap<ChartId, std::uint8_t> wished(chart_count, std::uint8_t{0}), refused(chart_count, std::uint8_t{0});
  for (const Wish& w : wishes)
    if (w.strip == strip) wished[w.chart] = 1;
  std::vector<std::vector<QuadId>> quads(chart_count);
  for (QuadId q : mesh.quads.ids())
    if (const ChartId c = mesh.chart[q]; c.valid() && c.index() < chart_count && wished[c] != 0) quads[c.index()].push_back(q);
  IdMap<VertexId, ChartId> taken(mesh.position.size());
  std::vector<ChartId> batch;
  for (ChartId c : wished.ids()) {
    if (wished[c] == 0) continue;
    const bool alone = ledger.at(strip, c) == Standing::Alone;
    if (alone && !batch.empty()) continue;
    const bool clear = std::all_of(quads[c.index()].begin(), quads[c.index()].end(), [&](QuadId q) {
      return std::none_of(mesh.quads[q].begin(), mesh.quads[q].end(), [&](VertexId v) { return taken[v].valid(); });
    });
    if (!clear) continue;
    for (QuadId q : quads[c.index()])
      for (VertexId v : mesh.quads[q]) taken[v] = c;
    batch.push_back(c);
    if (alone) break;
  }
  return batch;
}

SheetRequest round_charts(const HexMesh& mesh, const IdMap<QuadId, QuadSides>& sides, const std::vector<ChartId>& batch, StripTakes strip) {
  SheetRequest request;
  request.strip = strip;
  request.inner.assign(mesh.hexes.size(), 0);
  for (QuadId q : mesh.quads.ids()) {
    if (!std::binary_search(batch.begin(), batch.end(), mesh.chart[q])) continue;
    for (HexId h : {sides[q].back, sides[q].front})
      if (h.valid()) request.inner[h] = 1;
  }
  request.faces = faces_between(mesh, request.inner);
  return request;
}

// The charts of the batch whose hexes touch a pinched vertex.
std::vector<ChartId> pinched_charts(const HexMesh& mesh, const IdMap<QuadId, QuadSides>& sides, const std::vector<ChartId>& batch,
                                    const std::vector<VertexId>& pinched) {
  std::vector<ChartId> charts;
  for (QuadId q : mesh.quads.ids()) {
    const ChartId c = mesh.chart[q];
    if (!std::binary_search(batch.begin(), batch.end(), c)) continue;
    for (HexId h : {sides[q].back, sides[q].front}) {
      if (!h.valid()) continue;
      for (VertexId v : mesh.hexes[h])
        if (std::binary_search(pinched.begin(), pinched.end(), v)) charts.push_back(c);
    }
  }
  std::sort(charts.begin(), charts.end());
  charts.erase(std::unique(charts.begin(), charts.end()), charts.end());
  return charts;
}

Diagnostic pinch_report(const char* what, ChartId chart, const Features& features, const std::vector<VertexId>& pinched) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::TopologyChanged;
  diagnostic.severity = Severity::Info;
  diagnostic.message = std::string(what) + " round chart " + std::to_string(chart.value) + ": it would pinch the mesh at " +
                       std::to_string(pinched.size()) + " vertices";
  diagnostic.values = {
      {"chart", chart.value}, {"patch", features.patch_of_chart[chart].value}, {"vertices", static_cast<double>(pinched.size())}};
  return diagnostic;
}

std::vector<Wish> gather_wishes(const HexMesh& mesh, const ChartBorders& borders, const Features& features, Ledger& ledger) {
  std::vector<Wish> wishes;
  for (const BorderConflict& conflict : border_conflicts(mesh, borders, features))
    if (const auto wish = cure(conflict, borders, ledger)) wishes.push_back(*wish);
  std::sort(wishes.begin(), wishes.end(),
            [](const Wish& a, const Wish& b) { return a.strip != b.strip ? a.strip == StripTakes::Outer : a.chart < b.chart; });
  wishes.erase(std::unique(wishes.begin(), wishes.end()), wishes.end());
  return wishes;
}

}  // namespace

HexMesh wrap_ridges(HexMesh mesh, const Features& features, const std::vector<CreaseEdge>& creases, Context& context) {
  mesh = wrap_creases(std::move(mesh), creases, features, context);
  Ledger ledger;
  for (auto& map : ledger.of) map.assign(features.chart_count(), Standing::Open);
  while (true) {
    context.checkpoint();
    const std::vector<Wish> wishes = gather_wishes(mesh, chart_borders(mesh, features.chart_count()), features, ledger);
    if (wishes.empty()) break;
    const StripTakes strip = wishes.front().strip;
    const std::vector<ChartId> batch = choose_batch(mesh, wishes, ledger);
    const IdMap<QuadId, QuadSides> sides = quad_sides(mesh);
    SheetRequest request = round_charts(mesh, sides, batch, strip);
    if (const auto pinched = pinched_vertices(mesh, request); !pinched.empty()) {
      if (batch.size() > 1) {
        for (ChartId c : pinched_charts(mesh, sides, batch, pinched)) ledger.at(strip, c) = Standing::Alone;
        continue;
      }
      const bool partly = shrink_from_pinches(mesh, request);
      context.adjusted(pinch_report(partly ? "a gap in the ridge layer" : "no ridge layer", batch.front(), features, pinched));
      if (!partly) {
        ledger.at(strip, batch.front()) = Standing::Skipped;
        continue;
      }
    }
    mesh = insert_row(std::move(mesh), request, features);
    for (ChartId c : batch) ledger.at(strip, c) = Standing::Wrapped;
  }
  return mesh;
}

}  // namespace strata
