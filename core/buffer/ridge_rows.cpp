#include "core/buffer/ridge_rows.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/buffer/thicken.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

constexpr int kShrinks = 8;  // of the inner side, each by the hexes round its pinches
constexpr double kSheetShare = 1.0 / 3;  // of the edges that the new layer cuts off

// What holds an old border vertex once the ridge has gone with its copy.
class Reattach {
 public:
  Reattach(const HexMesh& mesh, const Features& features, const Sheet& sheet)
      : mesh_(mesh), features_(features), sheet_(sheet), round_(quads_round_vertices(mesh)) {}

  [[nodiscard]] Attachment of(VertexId v) const {
    const std::vector<ChartId> charts = charts_at(v);
    const Attachment was = mesh_.attachment[v];
    if (was.hold == Hold::Corner && was.of >= 0 && static_cast<std::size_t>(was.of) < features_.corners.size())
      for (const bool by_charts : {true, false})
        for (CurveId curve : features_.corners[CornerId(was.of)].curves) {
          // Charts between which curves were given up share one label: then the labels of quads alone say where a curve runs.
          const bool fits = by_charts ? runs_between(curve, charts) : charts.size() > 1;
          if (fits && continues_at(curve, v, CornerId(was.of), by_charts)) return {Hold::Curve, curve.value};
        }
    // The row ends here, and the ridge goes on along old vertices.
    if (was.hold == Hold::Curve && charts.size() > 1 && continues_at(CurveId(was.of), v, CornerId(), false)) return was;
    return {Hold::Chart, charts.size() == 1 ? charts.front().value : kWholeSurface};
  }
  // Neighbours of v along the boundary that are not copies made by the sheet.
  [[nodiscard]] std::vector<VertexId> neighbours(VertexId v) const {
    std::vector<VertexId> result;
    for (QuadId q : round_.of(v)) {
      const QuadVertices& quad = mesh_.quads[q];
      const auto at = static_cast<std::size_t>(std::find(quad.begin(), quad.end(), v) - quad.begin());
      for (VertexId w : {quad[(at + 1) & 3], quad[(at + 3) & 3]})
        if (is_old(w) && std::find(result.begin(), result.end(), w) == result.end()) result.push_back(w);
    }
    return result;
  }
  [[nodiscard]] bool on_surface(VertexId v) const { return !round_.of(v).empty(); }

 private:
  [[nodiscard]] bool is_old(VertexId v) const { return v.index() < sheet_.inner_copy.size(); }
  [[nodiscard]] std::vector<ChartId> charts_at(VertexId v) const {
    std::vector<ChartId> charts;
    for (QuadId q : round_.of(v))
      if (std::find(charts.begin(), charts.end(), mesh_.chart[q]) == charts.end()) charts.push_back(mesh_.chart[q]);
    std::sort(charts.begin(), charts.end());
    return charts;
  }
  [[nodiscard]] bool runs_between(CurveId id, const std::vector<ChartId>& charts) const {
    const Curve& curve = features_.curves[id];
    const auto has = [&](ChartId c) { return std::binary_search(charts.begin(), charts.end(), c); };
    // A crease that ends at the corner inside a chart does not run along the border of that chart.
    return has(curve.left) && has(curve.right) && (curve.left != curve.right || charts.size() == 1);
  }
  // An edge path of the curve leaves v: the next vertex is on the curve, or it is the curve's other corner.
  [[nodiscard]] bool continues_at(CurveId id, VertexId v, CornerId from, bool by_charts) const {
    const Curve& curve = features_.curves[id];
    for (VertexId w : neighbours(v)) {
      if (sheet_.inner_copy[w].valid()) continue;  // along the sheet, not away from it
      const Attachment& a = mesh_.attachment[w];
      const bool on_curve = a.hold == Hold::Curve && a.of == id.value;
      const bool at_end = a.hold == Hold::Corner && a.of != from.value && (a.of == curve.first.value || a.of == curve.last.value);
      if ((on_curve || at_end) && (by_charts || parts_charts(v, w))) return true;
    }
    return false;
  }
  [[nodiscard]] bool parts_charts(VertexId v, VertexId w) const {
    ChartId first;
    for (QuadId q : round_.of(v)) {
      const QuadVertices& quad = mesh_.quads[q];
      if (std::find(quad.begin(), quad.end(), w) == quad.end()) continue;
      if (first.valid() && mesh_.chart[q] != first) return true;
      first = mesh_.chart[q];
    }
    return false;
  }

  const HexMesh& mesh_;
  const Features& features_;
  const Sheet& sheet_;
  VertexStars<QuadId> round_;
};

// Outer strip: the ridge went with the copies. Inner strip: it stayed, and the copies slide on C.
void reattach(HexMesh& mesh, const Features& features, const Sheet& sheet, StripTakes strip) {
  const Reattach decide(mesh, features, sheet);
  std::vector<std::pair<VertexId, Attachment>> changes;
  for (VertexId v : sheet.inner_copy.ids()) {
    const VertexId copy = sheet.inner_copy[v];
    if (!copy.valid() || mesh.attachment[v].hold == Hold::Free) continue;
    const VertexId leaves = strip == StripTakes::Outer ? v : copy;
    if (decide.on_surface(leaves)) changes.emplace_back(leaves, decide.of(leaves));
  }
  for (const auto& [v, attachment] : changes) mesh.attachment[v] = attachment;
}

// Inside the volume copies move into S; on the surface whichever vertex left the ridge moves away from it.
std::vector<Push> plan_pushes(const HexMesh& mesh, const Sheet& sheet, StripTakes strip) {
  const std::size_t old_vertices = sheet.inner_copy.size();
  const VertexStars<QuadId> quads = quads_round_vertices(mesh);
  const auto on_sheet = [&](VertexId v) { return v.index() >= old_vertices || sheet.inner_copy[v].valid(); };
  // Sums over the hexes on the side that v moves into: edge neighbours off the sheet, and hex centres where there are none.
  struct Pull {
    Vec3 off = Vec3::Zero(), centre = Vec3::Zero();
    int offs = 0, centres = 0;
  };
  IdMap<VertexId, std::int32_t> index(mesh.position.size(), -1);
  std::vector<VertexId> moving;
  for (VertexId v : sheet.inner_copy.ids()) {
    if (!sheet.inner_copy[v].valid()) continue;
    const VertexId copy = sheet.inner_copy[v];
    const bool surface = !quads.of(v).empty() && !quads.of(copy).empty();
    const VertexId mover = surface && strip == StripTakes::Outer ? v : copy;
    index[mover] = static_cast<std::int32_t>(moving.size());
    moving.push_back(mover);
  }
  std::vector<Pull> pulls(moving.size());
  const auto on_surface = [&](VertexId v) { return !quads.of(v).empty(); };
  for (HexId h = HexId(0); h < sheet.first_hex; h = HexId(h.value + 1)) {
    const HexVertices& hex = mesh.hexes[h];
    for (std::size_t c = 0; c < 8; ++c) {
      if (index[hex[c]] < 0) continue;
      Pull& pull = pulls[static_cast<std::size_t>(index[hex[c]])];
      Vec3 centre = Vec3::Zero();
      for (VertexId w : hex) centre += 0.125 * mesh.position[w];
      pull.centre += centre;
      ++pull.centres;
      for (std::int8_t n : kHexCorners[c]) {
        const VertexId w = hex[static_cast<std::size_t>(n)];
        // A vertex of the surface moves along the surface.
        if (on_sheet(w) || (on_surface(hex[c]) && !on_surface(w))) continue;
        pull.off += mesh.position[w];
        ++pull.offs;
      }
    }
  }
  std::vector<Push> pushes;
  for (std::size_t i = 0; i < moving.size(); ++i) {
    const Pull& pull = pulls[i];
    const Vec3& p = mesh.position[moving[i]];
    if (pull.offs > 0) pushes.push_back({moving[i], kSheetShare * (pull.off / pull.offs - p)});
    else if (pull.centres > 0) pushes.push_back({moving[i], kSheetShare * (pull.centre / pull.centres - p)});
  }
  return pushes;
}

}  // namespace

bool shrink_from_pinches(const HexMesh& mesh, SheetRequest& request) {
  for (int i = 0; i < kShrinks; ++i) {
    const std::vector<VertexId> pinched = pinched_vertices(mesh, request);
    if (pinched.empty()) return !request.faces.empty();
    IdMap<VertexId, std::uint8_t> near(mesh.position.size(), 0);
    for (VertexId v : pinched) near[v] = 1;
    for (HexId h : mesh.hexes.ids())
      if (request.inner[h] != 0 && std::any_of(mesh.hexes[h].begin(), mesh.hexes[h].end(), [&](VertexId v) { return near[v] != 0; }))
        request.inner[h] = 0;
    request.faces = faces_between(mesh, request.inner);
  }
  return false;
}

HexMesh insert_row(HexMesh mesh, const SheetRequest& request, const Features& features) {
  SheetInsertion done = insert_sheet(std::move(mesh), request);
  mesh = std::move(done.mesh);
  reattach(mesh, features, done.sheet, request.strip);
  push_where_positive(mesh, plan_pushes(mesh, done.sheet, request.strip));
  return mesh;
}

}  // namespace strata
