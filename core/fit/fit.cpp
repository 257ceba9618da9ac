#include "core/fit/fit.h"

#include <string>

#include "core/base/context.h"
#include "core/fit/own_side.h"
#include "core/optimise/optimise.h"

namespace strata {
namespace {

constexpr int kSmoothSweeps = 6;
constexpr int kFeatureSweeps = 10;
constexpr int kPolishRounds = 2;
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

}  // namespace

FitResult fit_to_smooth(HexMesh mesh, const Ground& ground, bool thin_places, Context& context) {
  for (const QuadVertices& q : mesh.quads)
    for (VertexId v : q) mesh.attachment[v] = {Hold::Chart, kWholeSurface};
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
  OptimiseOptions options = feature_options();
  options.sweeps = options.arrival_sweeps = 0;
  options.arrival = Arrival::AtOnce;
  return optimise(std::move(mesh), request, options, context).mesh;
}

HexMesh settle_on_features(HexMesh mesh, const Ground& ground, Context& context) {
  OptimiseRequest request;
  request.ground = &ground;
  mesh = optimise(std::move(mesh), request, feature_options(), context).mesh;
  return polish(std::move(mesh), request, kPolishGoal, kPolishRounds, context).mesh;
}

}  // namespace strata
