#include "core/fit/fit.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/context.h"
#include "core/fit/openings.h"
#include "core/fit/own_side.h"
#include "core/mesh/hex.h"
#include "core/mesh/part.h"
#include "core/optimise/optimise.h"

namespace strata {
namespace {

constexpr int kSmoothSweeps = 6;
constexpr int kFeatureSweeps = 10;
constexpr int kLateSweeps = 40;     // more where hexes have not found their shape: sheets inserted flat take long to open
constexpr int kLateRings = 3;
constexpr double kLateGoal = 0.25;  // shape of the corners, see poorest_shape
constexpr int kPolishRounds = 4;
constexpr double kPolishGoal = 0.4;      // scaled Jacobian the worst hexes are raised to, where possible
constexpr double kHealthy = 0.05;  // the smooth fit goes towards the surface only as far as hexes stay so good: what follows needs room
constexpr double kAcceptable = 0.02;  // projections never push a good hex below

OptimiseOptions feature_options() {
  OptimiseOptions options;
  options.sweeps = kFeatureSweeps;
  options.power = 2;
  options.min_scaled_jacobian = kAcceptable;
  return options;
}

// The poorest corner's determinant over what a cube of its edges' mean square length would have: 1 for a cube, at most the scaled Jacobian,
// and small for hexes that are flat or long, too.
double poorest_shape(const std::array<Vec3, 8>& p) {
  double worst = 1;
  for (std::size_t c = 0; c < 8; ++c) {
    const auto edge = [&](std::size_t k) -> Vec3 { return p[static_cast<std::uint8_t>(kHexCorners[c][k])] - p[c]; };
    const Vec3 a = edge(0), b = edge(1), d = edge(2);
    const double square = (a.squaredNorm() + b.squaredNorm() + d.squaredNorm()) / 3;
    worst = std::min(worst, square > 0 ? a.cross(b).dot(d) / (square * std::sqrt(square)) : 0);
  }
  return worst;
}

// Everything relaxes, and goes on where that was not enough.
HexMesh relax(HexMesh mesh, const Ground& ground, const Neighbours& neighbours, Context& context) {
  OptimiseRequest request;
  request.ground = &ground;
  request.neighbours = &neighbours;
  request.open_skin = OpenSkin::Slides;
  mesh = optimise(std::move(mesh), request, feature_options(), context).mesh;
  const std::vector<HexId> late = hexes_where(mesh, [](const std::array<Vec3, 8>& p) { return poorest_shape(p) < kLateGoal; });
  if (late.empty()) return mesh;
  const IdMap<VertexId, std::uint8_t> seeds = vertices_of(mesh, late);
  request.seeds = &seeds;
  OptimiseOptions options = feature_options();
  options.sweeps = kLateSweeps;
  options.rings = kLateRings;
  return optimise(std::move(mesh), request, options, context).mesh;
}

void report_openings(const HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& over_opening, const Frame& frame, Context& context) {
  Diagnostic diagnostic;
  for (VertexId v : over_opening.ids()) {
    if (over_opening[v] == 0) continue;
    ++diagnostic.count;
    diagnostic.box.add(frame.to_input(mesh.position[v]));
  }
  if (diagnostic.count == 0) return;
  diagnostic.reason = Reason::SurfaceNotClosed;
  diagnostic.severity = Severity::Warning;
  diagnostic.values = {{"vertices", static_cast<double>(diagnostic.count)}};
  diagnostic.message = "openings of the surface are closed by a skin of the mesh's own (" + std::to_string(diagnostic.count) +
                       " vertices): close them in the surface where its shape matters there";
  context.adjusted(std::move(diagnostic));
}

}  // namespace

FitResult fit_to_smooth(HexMesh mesh, const Ground& ground, const Surface& whole, bool thin_places, Context& context) {
  const IdMap<VertexId, std::uint8_t> over_opening = vertices_over_openings(mesh, ground, whole);
  report_openings(mesh, over_opening, ground.surface().frame, context);
  for (const QuadVertices& q : mesh.quads)
    for (VertexId v : q) mesh.attachment[v] = over_opening[v] != 0 ? Attachment{} : Attachment{Hold::Chart, kWholeSurface};
  if (thin_places) take_own_side(mesh, ground);
  OptimiseRequest request;
  request.ground = &ground;
  OptimiseOptions options;
  options.sweeps = kSmoothSweeps;
  options.arrival = Arrival::AtOnce;
  options.power = 2;
  options.min_scaled_jacobian = kHealthy;
  OptimiseResult result = optimise(std::move(mesh), request, options, context);
  return {.mesh = std::move(result.mesh), .relaxed = result.off_ground};
}

HexMesh arrive_at_features(HexMesh mesh, const Ground& ground, Context& context) {
  OptimiseRequest request;
  request.ground = &ground;
  request.open_skin = OpenSkin::Slides;
  OptimiseOptions options = feature_options();
  options.sweeps = options.arrival_sweeps = 0;
  options.arrival = Arrival::AtOnce;
  return optimise(std::move(mesh), request, options, context).mesh;
}

HexMesh settle_on_features(HexMesh mesh, const Ground& ground, Context& context) {
  OptimiseRequest request;
  request.ground = &ground;
  request.open_skin = OpenSkin::Slides;
  const Neighbours neighbours(mesh);
  request.neighbours = &neighbours;
  mesh = relax(std::move(mesh), ground, neighbours, context);
  return polish(std::move(mesh), request, kPolishGoal, kPolishRounds, context, Regard::AnglesAndShape).mesh;
}

}  // namespace strata
