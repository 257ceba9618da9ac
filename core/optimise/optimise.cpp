#include "core/optimise/optimise.h"

#include <algorithm>
#include <cmath>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/optimise/descend.h"
#include "core/optimise/workspace.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr int kUntangleSweeps = 60;  // at most; each touches only the surroundings of bad hexes
constexpr int kPatience = 12;        // sweeps without fewer bad hexes before untangling gives up
constexpr int kUntangleRings = 3;    // of vertices round bad hexes that take part
constexpr int kUntangleSteps = 4;    // Newton steps a visit
constexpr double kGentle = 0.3;      // scaled Jacobian that first steps towards the ground may not cost
constexpr int kArrivalRings = 3;     // of vertices round one that is still on its way

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

// Sweeps near the bad hexes until there are none. Sound hexes may give way for a while: energies that are finite everywhere lead round
// obstacles that strict moves cannot pass. What came of it is kept when fewer hexes are bad in the end.
void untangle(Workspace& work, const OptimiseOptions& options, const Context& context) {
  const std::int64_t before = work.inverted();
  if (before == 0) return;
  Workspace::Snapshot snapshot = work.snapshot();
  work.keep_sound(false);
  std::int64_t least = before;
  for (int sweep = 0, idle = 0; sweep < kUntangleSweeps && work.inverted() > 0 && idle < kPatience; ++sweep) {
    work.wake_only_near_bad(kUntangleRings);
    work.sweep(
        [&](VertexId v, const Star& star) {
          DescentOptions descent;
          descent.eps = regularisation(star, sweep);
          descent.steps = kUntangleSteps;
          descent.floor = descent.draw_floor = options.min_scaled_jacobian;
          return visit(work, v, star, descent, false);
        },
        context);
    ++idle;
    if (work.inverted() < least) {
      least = work.inverted();
      idle = 0;
    }
  }
  work.keep_sound(true);
  if (work.inverted() > before) work.restore(std::move(snapshot));
}

}  // namespace

OptimiseResult optimise(HexMesh mesh, const OptimiseRequest& request, const OptimiseOptions& options, Context& context) {
  Workspace work(mesh, request, options.rings, options.project);
  if (options.project && options.arrival == Arrival::AtOnce) work.put_on_ground();
  untangle(work, options, context);
  const auto visit_with = [&](double gentle, int sweep) {
    return [&work, &options, gentle, sweep](VertexId v, const Star& star) {
      DescentOptions descent;
      descent.exponent = star.all_sound() ? exponent_of(options.power) : 1;
      descent.eps = regularisation(star, 20 + sweep);
      descent.floor = descent.draw_floor = std::max(gentle, options.min_scaled_jacobian);
      return visit(work, v, star, descent, options.project);
    };
  };
  work.wake_all();
  int sweep = 0;
  for (; sweep < options.sweeps; ++sweep) {
    // Held vertices arrive gently: the floor under projections sinks from sweep to sweep, so that the inside can follow.
    const double gentle = kGentle * (1 - static_cast<double>(sweep) / std::max(options.sweeps, 1));
    if (work.sweep(visit_with(gentle, sweep), context) == 0) break;
  }
  for (int late = 0; options.project && late < options.arrival_sweeps && work.off_ground() > 0; ++late, ++sweep) {
    work.wake_only_near_off_ground(kArrivalRings);
    if (work.sweep(visit_with(0, sweep), context) == 0) break;
  }
  const std::int64_t off_ground = work.off_ground();
  return {std::move(mesh), off_ground, sweep};
}

}  // namespace strata
