#include "core/optimise/optimise.h"

#include <algorithm>
#include <cmath>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/optimise/descend.h"
#include "core/optimise/result.h"
#include "core/optimise/workspace.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr int kUntangleSweeps = 60;   // at most, before the sweeps asked for; each touches only the surroundings of bad hexes
constexpr int kLooseSweeps = 40;

// Exponent on u = (mean ratio)^(3/2).
int exponent_of(double power) { return std::clamp(static_cast<int>(std::lround(power / 1.5)), 1, 12); }

// Regularisation in a star with a bad hex: a share of how deep the worst corner lies, and not less than a width that shrinks as the sweeps
// go on, so that corners end up clearly above zero. Garanzha et al. 2021 choose one for the whole mesh; here each star has its own, and
// stars without a bad hex none at all.
double regularisation(const Star& star, int sweep) {
  if (star.all_sound()) return 0;
  const double deep = std::min(star.least_determinant(Vec3::Zero()), 0.0);
  const double width = std::max(0.3 * std::pow(0.85, sweep), 1e-3);
  return std::sqrt(width * width + 0.04 * deep * deep);
}

// Sweeps near the bad hexes until there are none. `rings` of vertices round them take part.
void untangle(Workspace& work, int sweeps, int rings, bool project, double floor, const Context& context) {
  for (int sweep = 0; sweep < sweeps && work.inverted() > 0; ++sweep) {
    const auto near = work.vertices_near(work.bad(), rings);
    work.wake_near(near);
    work.sweep(
        [&](VertexId v, const Star& star) {
          DescentOptions options;
          options.eps = regularisation(star, sweep);
          options.steps = 4;
          options.floor = options.draw_floor = floor;
          return near[v] != 0 && visit(work, v, star, options, project);
        },
        context);
  }
}

// What strict moves cannot free: sound hexes may give way for a while. Kept only when fewer hexes are bad in the end.
void untangle_loosely(Workspace& work, double floor, const Context& context) {
  const std::int64_t before = work.inverted();
  if (before == 0) return;
  Workspace::Snapshot snapshot = work.snapshot();
  work.keep_sound(false);
  untangle(work, kLooseSweeps, 4, false, floor, context);
  work.keep_sound(true);
  if (work.inverted() >= before) work.restore(std::move(snapshot));
}

}  // namespace

OptimiseResult optimise(HexMesh mesh, const OptimiseRequest& request, const OptimiseOptions& options, Context& context) {
  Workspace work(mesh, request, options.rings, options.project);
  untangle(work, kUntangleSweeps, 2, options.project, options.min_scaled_jacobian, context);
  untangle_loosely(work, options.min_scaled_jacobian, context);
  work.wake_all();
  int sweep = 0;
  for (; sweep < options.sweeps || (options.project && sweep < options.sweeps + options.arrival_sweeps && work.off_ground() > 0); ++sweep) {
    // Held vertices arrive gently: the floor under projections sinks from sweep to sweep, so that the inside can follow.
    const double gentle = 0.3 * (1 - 2.0 * sweep / std::max(options.sweeps, 1));
    const std::int64_t moved = work.sweep(
        [&](VertexId v, const Star& star) {
          DescentOptions descent;
          descent.exponent = star.all_sound() ? exponent_of(options.power) : 1;
          descent.eps = regularisation(star, 20 + sweep);
          descent.floor = std::max(gentle, options.min_scaled_jacobian);
          descent.draw_floor = std::max(gentle, options.min_scaled_jacobian);
          return visit(work, v, star, descent, options.project);
        },
        context);
    if (moved == 0) break;
  }
  return summarise(std::move(mesh), request, sweep);
}

}  // namespace strata
