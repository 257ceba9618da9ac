// Corners to vertices, curves to edge paths, charts to quads (Gao, Shen, Panozzo 2019 for the idea of routing curves on the boundary
// graph; the rules are ours). What cannot be represented is softened: the vertices slide on the surface, and it is reported.
#include <string>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/fit/fit.h"
#include "core/fit/matching.h"

namespace strata {
namespace {

std::int64_t report_softened(const Matching& m, Context& context) {
  const Features& features = m.ground.features();
  const Surface& surface = m.ground.surface();
  IdMap<CurveId, std::uint8_t> held(features.curves.size(), std::uint8_t{0});
  for (std::size_t r = 0; r < m.plan.routes.size(); ++r)
    if (!m.path[r].empty())
      for (CurveId c : m.plan.routes[r].curves) held[c] = 1;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::FeatureSoftened;
  diagnostic.severity = Severity::Warning;
  double length = 0;
  std::int64_t softened = 0;
  for (CurveId c : features.curves.ids()) {
    if (held[c]) continue;
    ++softened;
    length += features.curves[c].length / surface.frame.scale;
    for (PointId p : features.curves[c].points) diagnostic.box.add(surface.frame.to_input(surface.points[p]));
  }
  if (softened == 0) return 0;
  diagnostic.count = softened;
  diagnostic.values = {{"curves", static_cast<double>(softened)}, {"length", length}};
  diagnostic.message =
      std::to_string(softened) + " feature curves (length " + std::to_string(length) +
      " in all) are too small for the cells, or have no path of mesh edges; the mesh rounds them off. A smaller size there keeps them.";
  context.adjusted(std::move(diagnostic));
  return softened;
}

}  // namespace

FitResult match_features(HexMesh mesh, const Ground& ground, Context& context) {
  const Skin skin(mesh);
  const PointTree tree(mesh, skin.vertices());
  IdMap<VertexId, double> size(mesh.position.size(), 0.0);
  parallel_for(skin.vertices().size(), [&](std::size_t i) { size[skin.vertices()[i]] = skin.size_at(mesh, skin.vertices()[i]); });
  const RoutePlan plan = plan_routes(ground, [&](const Vec3& p) { return size[tree.nearest(p)]; });

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
  FitResult result;
  result.softened = report_softened(m, context);
  label_quads(m, mesh);  // m looks at positions and quads only, which stay
  result.mesh = std::move(mesh);
  return result;
}

}  // namespace strata
