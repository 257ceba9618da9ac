// Corners to vertices, curves to edge paths, charts to quads (Gao, Shen, Panozzo 2019 for the idea of routing curves on the boundary
// graph; the rules are ours). What cannot be represented is softened: the vertices slide on the surface.
#include <string>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/fit/fit.h"
#include "core/fit/matching.h"

namespace strata {
namespace {

std::vector<CurveId> softened_curves(const Matching& m) {
  const Features& features = m.ground.features();
  IdMap<CurveId, std::uint8_t> held(features.curves.size(), std::uint8_t{0});
  for (std::size_t r = 0; r < m.plan.routes.size(); ++r)
    if (!m.path[r].empty())
      for (CurveId c : m.plan.routes[r].curves) held[c] = 1;
  std::vector<CurveId> softened;
  for (CurveId c : features.curves.ids())
    if (!held[c]) softened.push_back(c);
  return softened;
}

// Edges of paths between quads of one chart.
std::vector<CreaseEdge> crease_edges(const Matching& m, const HexMesh& labelled) {
  std::vector<CreaseEdge> edges;
  for (std::size_t r = 0; r < m.path.size(); ++r)
    for (std::int32_t e : m.path[r]) {
      const SkinEdge& edge = m.skin.edges()[static_cast<std::size_t>(e)];
      const auto quads = m.skin.quads_of(edge);
      if (quads.size() == 2 && labelled.chart[quads[0]] == labelled.chart[quads[1]])
        edges.push_back({static_cast<std::int32_t>(r), edge.a, edge.b});
    }
  return edges;
}

}  // namespace

void report_softened(const std::vector<CurveId>& curves, const Ground& ground, Context& context) {
  if (curves.empty()) return;
  const Features& features = ground.features();
  const Surface& surface = ground.surface();
  Diagnostic diagnostic;
  diagnostic.reason = Reason::FeatureSoftened;
  diagnostic.severity = Severity::Warning;
  double length = 0;
  for (CurveId c : curves) {
    length += features.curves[c].length / surface.frame.scale;
    for (PointId p : features.curves[c].points) diagnostic.box.add(surface.frame.to_input(surface.points[p]));
  }
  diagnostic.count = static_cast<std::int64_t>(curves.size());
  diagnostic.values = {{"curves", static_cast<double>(curves.size())}, {"length", length}};
  diagnostic.message = std::to_string(curves.size()) + " feature curves (length " + std::to_string(length) +
                       " in all) are too small or too close for the cells; the mesh rounds them off. A smaller size there keeps them.";
  context.adjusted(std::move(diagnostic));
}

Match match_features(HexMesh mesh, const Ground& ground, const IdMap<CurveId, std::uint8_t>& let_go, Context& context) {
  const Skin skin(mesh);
  const PointTree tree(mesh, skin.vertices());
  IdMap<VertexId, double> size(mesh.position.size(), 0.0);
  parallel_for(skin.vertices().size(), [&](std::size_t i) { size[skin.vertices()[i]] = skin.size_at(mesh, skin.vertices()[i]); });
  const RoutePlan plan = plan_routes(ground, let_go, [&](const Vec3& p) { return size[tree.nearest(p)]; });

  const std::size_t n = mesh.position.size();
  Matching m{mesh,
             ground,
             skin,
             tree,
             plan,
             size,
             IdMap<CornerId, VertexId>(plan.stands_for.size()),
             IdMap<VertexId, CornerId>(n),
             IdMap<VertexId, std::int32_t>(n, -1),
             IdMap<VertexId, std::int32_t>(n, -1),
             std::vector<std::int32_t>(skin.edges().size(), -1),
             std::vector<std::array<Port, 2>>(plan.routes.size()),
             std::vector<std::vector<std::int32_t>>(plan.routes.size())};
  match_corners(m);
  route_paths(m, context);
  Match result;
  result.softened = softened_curves(m);
  result.chart_of = label_quads(m, mesh);  // m looks at positions and quads only, which stay
  result.creases = crease_edges(m, mesh);
  result.mesh = std::move(mesh);
  return result;
}

}  // namespace strata
