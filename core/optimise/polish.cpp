#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/optimise/descend.h"
#include "core/optimise/optimise.h"
#include "core/optimise/workspace.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr int kSweepsPerRound = 6;
constexpr int kRings = 2;      // of vertices round a poor hex that help it
constexpr int kHalvings = 5;
constexpr double kShapeShare = 1e-3;  // of the shape energy where angles alone count: decides only where angles do not
constexpr double kShapely = 2;  // u of a corner (star.h) that weighs as much as a right angle, where shape counts: u of a hex n times
    // as flat as a cube is about n / 2

double jacobian_of(const HexMesh& mesh, HexId h) {
  std::array<Vec3, 8> p;
  for (std::size_t c = 0; c < 8; ++c) p[c] = mesh.position[mesh.hexes[h][c]];
  return corner_scaled_jacobian(p);
}

// 1 / SJ and u / kShapely are raised to the same power, so that the worse of the two decides.
Star::AngleEnergy energy_of(int exponent, Regard regard) {
  if (regard == Regard::Angles) return {exponent, exponent, kShapeShare};
  return {exponent, 2 * exponent, std::pow(kShapely, -2 * exponent)};
}

std::vector<HexId> hexes_under(double goal, const HexMesh& mesh) {
  std::vector<std::uint8_t> is_poor(mesh.hexes.size(), 0);
  parallel_for(mesh.hexes.size(), [&](std::size_t i) { is_poor[i] = jacobian_of(mesh, HexId(i)) < goal ? 1 : 0; });
  std::vector<HexId> poor;
  for (std::size_t i = 0; i < is_poor.size(); ++i)
    if (is_poor[i] != 0) poor.emplace_back(i);
  return poor;
}

// A vertex moves only when the angle energy of its star falls and its worst corner does not sink below the goal or below what it was.
bool lift(Workspace& work, VertexId v, const Star& star, const Star::AngleEnergy& energy, double goal) {
  if (!star.all_sound()) return false;
  const Attachment attachment = work.attachment(v);
  const bool free = attachment.hold == Hold::Free;
  if (!free && !work.foot(v).on_ground) return false;
  const Freedom freedom = free ? work.freedom_of_free(v) : freedom_of(attachment.hold, work.foot(v).direction);
  if (freedom.dimensions == 0) return false;
  const double worst = star.scaled_jacobian(Vec3::Zero());
  const double floor = std::min(worst, goal);
  const double before = star.angle_energy(Vec3::Zero(), energy);
  Vec3 gradient;
  Mat3 hessian;
  star.angle_derivatives(Vec3::Zero(), energy, gradient, hessian);
  Vec3 d = newton_step(freedom, gradient, hessian);
  const double longest = 0.5 * star.size();
  if (d.norm() > longest) d *= longest / d.norm();
  for (int i = 0; i < kHalvings && d.norm() > kStill * star.size(); ++i, d *= 0.4) {
    Vec3 on = d;
    Foothold at;
    if (!free) {
      at = work.ground()->project(attachment, work.position(v) + d, work.foot(v).hint);
      on = at.position - work.position(v);
    }
    if (!(star.angle_energy(on, energy) < before) || star.scaled_jacobian(on) < floor) continue;
    work.move(v, star, on);
    if (!free) {
      work.foot(v).direction = at.direction;
      work.foot(v).hint = at.hint;
    }
    return true;
  }
  return false;
}

}  // namespace

OptimiseResult polish(HexMesh mesh, const OptimiseRequest& request, double goal, int rounds, Context& context, Regard regard) {
  constexpr std::array<int, 4> kExponents{2, 4, 8, 12};  // SJ^-2k: later rounds look at the worst only
  std::vector<HexId> poor = hexes_under(goal, mesh);
  if (poor.empty()) return {std::move(mesh), 0, 0};
  // Everybody may move: from round to round, help reaches far beyond the rings of those that are poor now.
  Workspace work(mesh, request, -1, false);
  int sweeps = 0;
  for (int round = 0; round < rounds; ++round) {
    if (round > 0) poor = hexes_under(goal, mesh);
    if (poor.empty()) break;
    work.wake_only_near(poor, kRings);
    const int exponent = kExponents[std::min<std::size_t>(static_cast<std::size_t>(round), kExponents.size() - 1)];
    const Star::AngleEnergy energy = energy_of(exponent, regard);
    std::int64_t moved_in_round = 0;
    for (int sweep = 0; sweep < kSweepsPerRound; ++sweep, ++sweeps) {
      const std::int64_t moved = work.sweep([&](VertexId v, const Star& star) { return lift(work, v, star, energy, goal); }, context);
      moved_in_round += moved;
      if (moved == 0) break;
    }
    if (moved_in_round == 0 && round + 1 >= static_cast<int>(kExponents.size())) break;
  }
  const std::int64_t off_ground = work.off_ground();
  return {std::move(mesh), off_ground, sweeps};
}

}  // namespace strata
