#include "core/optimise/descend.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace strata {
namespace {

constexpr int kHalvings = 4;       // of a Newton step before it is given up
constexpr double kLeastGain = 1e-10;  // relative fall of the energy that counts

// The star's smallest scaled Jacobian at d; skipped where the energy already vouches for more than the floor (SJ >= 1/u).
bool keeps_floor(const Star& star, const Vec3& d, double worst_u, double floor) {
  if (worst_u * floor <= 1) return true;
  const double before = star.scaled_jacobian(Vec3::Zero());
  return star.scaled_jacobian(d) >= std::min(before, floor);
}

// Slides a vertex that stands on its ground: descends in the tangent space, steps back onto the ground, checks there.
bool slide(Workspace& work, VertexId v, const Star& star, const DescentOptions& options) {
  Foot& foot = work.foot(v);
  const Attachment attachment = work.attachment(v);
  Vec3 d = descend(star, freedom_of(attachment.hold, foot.direction), Vec3::Zero(), options);
  const double still = kStill * star.size();
  const Star::Value before = star.value(Vec3::Zero(), options.eps, options.exponent);
  for (int i = 0; i < kHalvings && d.norm() > still; ++i, d *= 0.5) {
    const Foothold at = work.ground()->project(attachment, work.position(v) + d, foot.hint);
    const Vec3 on = at.position - work.position(v);
    const Star::Value after = star.value(on, options.eps, options.exponent);
    if (!after.sound || !(after.energy < before.energy * (1 - kLeastGain)) || !acceptable(star, on, options)) continue;
    work.move(v, star, on);
    foot.direction = at.direction;
    foot.hint = at.hint;
    return on.norm() > still;
  }
  return false;
}

// Draws a vertex that is off its ground as far towards it as the star allows, then lets it slide beside it.
bool draw(Workspace& work, VertexId v, const Star& star, const DescentOptions& options) {
  Foot& foot = work.foot(v);
  const Attachment attachment = work.attachment(v);
  const Foothold at = work.ground()->project(attachment, work.position(v), foot.hint);
  const Vec3 way = at.position - work.position(v);
  foot.direction = at.direction;
  foot.hint = at.hint;
  DescentOptions gently = options;
  gently.floor = options.draw_floor;
  Vec3 d = Vec3::Zero();
  for (const double fraction : {1.0, 0.75, 0.5, 0.25, 0.125, 0.0625}) {
    if (!acceptable(star, fraction * way, gently)) continue;
    d = fraction * way;
    foot.on_ground = fraction == 1.0;
    break;
  }
  if (!foot.on_ground && (attachment.hold == Hold::Chart || attachment.hold == Hold::Curve))
    d = descend(star, freedom_of(attachment.hold, foot.direction), d, options);
  if (d != Vec3::Zero()) work.move(v, star, d);
  return true;  // until it is there, and once more when it just arrived
}

}  // namespace

Freedom freedom_of(Hold hold, const Vec3& direction) {
  Freedom freedom;
  if (hold == Hold::Free) return freedom;
  if (hold == Hold::Curve) {
    freedom.basis.col(0) = direction;
    freedom.dimensions = 1;
  } else if (hold == Hold::Chart) {
    freedom.basis.col(0) = direction.unitOrthogonal();
    freedom.basis.col(1) = direction.cross(freedom.basis.col(0));
    freedom.dimensions = 2;
  } else {
    freedom.dimensions = 0;
  }
  if (direction == Vec3::Zero()) freedom.dimensions = 0;
  return freedom;
}

Vec3 newton_step(const Freedom& freedom, const Vec3& g, const Mat3& H) {
  const Mat3& B = freedom.basis;
  switch (freedom.dimensions) {
    case 3: {  // H = L L^T, row by row
      const double a = std::sqrt(H(0, 0)), b = H(1, 0) / a, c = H(2, 0) / a, d = std::sqrt(H(1, 1) - b * b), e = (H(2, 1) - b * c) / d,
                   f = std::sqrt(H(2, 2) - c * c - e * e);
      const double y0 = -g[0] / a, y1 = (-g[1] - b * y0) / d, y2 = (-g[2] - c * y0 - e * y1) / f;
      const double z = y2 / f, y = (y1 - e * z) / d, x = (y0 - b * y - c * z) / a;
      return {x, y, z};
    }
    case 2: {
      const Vec3 a = B.col(0), b = B.col(1);
      const double h00 = a.dot(H * a), h01 = a.dot(H * b), h11 = b.dot(H * b), det = h00 * h11 - h01 * h01;
      if (!(det > 0)) return Vec3::Zero();
      const double g0 = a.dot(g), g1 = b.dot(g);
      return -((h11 * g0 - h01 * g1) * a + (h00 * g1 - h01 * g0) * b) / det;
    }
    case 1: {
      const Vec3 a = B.col(0);
      const double h = a.dot(H * a);
      return h > 0 ? Vec3(-a.dot(g) / h * a) : Vec3::Zero();
    }
    default: return Vec3::Zero();
  }
}

Vec3 descend(const Star& star, const Freedom& freedom, const Vec3& from, const DescentOptions& options) {
  Vec3 d = from;
  if (freedom.dimensions == 0) return d;
  const bool sound = star.all_sound();
  const double still = 0.2 * kStill * star.size();
  for (int step = 0; step < options.steps; ++step) {
    Vec3 gradient;
    Mat3 hessian;
    Star::Value at = star.derivatives(d, options.eps, options.exponent, gradient, hessian);
    Vec3 move = newton_step(freedom, gradient, hessian);
    const double length = move.norm();
    if (!(length > still)) break;  // converged, or not a number
    const auto try_move = [&](const Vec3& m) {
      const Star::Value next = star.value(d + m, options.eps, options.exponent);
      if (!next.sound || !(next.energy < at.energy * (1 - kLeastGain))) return false;
      if (sound && !keeps_floor(star, d + m, next.worst, options.floor)) return false;
      d += m;
      at = next;
      return true;
    };
    bool moved = false;
    for (int i = 0; i < kHalvings && !moved; ++i) {
      moved = try_move(move);
      if (!moved) move *= 0.4;
    }
    if (!moved) break;
    // Out of the regularised region Newton's steps are short: go on in the same direction while it pays.
    if (options.eps > 0)
      for (int i = 0; i < kHalvings && try_move(move); ++i) move *= 2;
  }
  return d;
}

bool acceptable(const Star& star, const Vec3& d, const DescentOptions& options) {
  const Star::Value after = star.value(d, options.eps, options.exponent);
  if (!after.sound) return false;
  if (star.all_sound()) return keeps_floor(star, d, after.worst, options.floor);
  const Star::Value before = star.value(Vec3::Zero(), options.eps, options.exponent);
  return after.worst <= std::max(before.worst, 1 / options.floor);
}

bool visit(Workspace& work, VertexId v, const Star& star, const DescentOptions& options, bool project) {
  if (work.attachment(v).hold == Hold::Free) {
    const Vec3 d = descend(star, work.freedom_of_free(v), Vec3::Zero(), options);
    if (d == Vec3::Zero()) return false;
    work.move(v, star, d);
    return d.norm() > kStill * star.size();
  }
  if (work.foot(v).on_ground) return slide(work, v, star, options);
  return project && draw(work, v, star, options);
}

}  // namespace strata
