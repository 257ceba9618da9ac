#include "core/optimise/star.h"

#include <algorithm>
#include <limits>

namespace strata {
namespace {

star_kernels::Place place(const Vec3& d) { return {d.x(), d.y(), d.z()}; }

double raised(double u, int exponent) {
  double r = u;
  for (int i = 1; i < exponent; ++i) r *= u;
  return r;
}

}  // namespace

void Star::complete() {
  // Lanes beyond the last hex are computed and thrown away: give them numbers.
  for (int h = hexes_; h % star_kernels::kLanes != 0; ++h) {
    for (std::size_t j = 0; j < 7; ++j)
      points_.x[j][h] = points_.x[j][0], points_.y[j][h] = points_.y[j][0], points_.z[j][h] = points_.z[j][0];
    for (std::size_t k = 0; k < 3; ++k) points_.w[k][h] = points_.w[k][0];
    points_.freedom[h] = star_kernels::kFree;
  }
  size_ = star_kernels::table().prepare(points_, hexes_, corners_) / (3 * hexes_);
}

double Star::least_determinant(const Vec3& d) const {
  double least = std::numeric_limits<double>::infinity();
  for (int h = 0; h < hexes_; ++h)
    for (int c = 0; c < 4; ++c) least = std::min(least, determinant(h, c, d));
  return least;
}

Star::Value Star::value(const Vec3& d, double eps, int exponent) const {
  const auto v = star_kernels::table().value(corners_, points_.freedom, hexes_, place(d), eps * eps, exponent);
  constexpr double kNever = std::numeric_limits<double>::infinity();
  if (!(v.least_bound > kFlat)) return {kNever, kNever, false};
  return {v.energy, v.worst, true};
}

Star::Value Star::derivatives(const Vec3& d, double eps, int exponent, Vec3& gradient, Mat3& hessian) const {
  star_kernels::Slopes s;
  const auto v = star_kernels::table().derivatives(corners_, hexes_, place(d), eps * eps, exponent, s);
  gradient = Vec3(s.gx, s.gy, s.gz);
  hessian << s.hxx, s.hxy, s.hxz, s.hxy, s.hyy, s.hyz, s.hxz, s.hyz, s.hzz;
  return {v.energy, v.worst, true};
}

double Star::scaled_jacobian(const Vec3& d) const { return star_kernels::table().scaled_jacobian(points_, corners_, hexes_, place(d)); }

Vec3 Star::edge(std::size_t h, std::size_t k) const {
  return {points_.x[1 + k][h] - points_.x[0][h], points_.y[1 + k][h] - points_.y[0][h], points_.z[1 + k][h] - points_.z[0][h]};
}

double Star::constant_lengths(std::size_t h, std::size_t corner) const {
  const double W = points_.w[0][h] * points_.w[1][h] * points_.w[2][h];
  if (corner == 0) return W;
  const std::size_t k = corner - 1;
  const auto from_e = [&](std::size_t j) {
    return Vec3(points_.x[j][h] - points_.x[1 + k][h], points_.y[j][h] - points_.y[1 + k][h], points_.z[j][h] - points_.z[1 + k][h]);
  };
  return W * std::sqrt(from_e(4 + k).squaredNorm() * from_e(4 + (k + 2) % 3).squaredNorm());
}

double Star::angle_energy(const Vec3& d, const AngleEnergy& energy) const {
  double sum = 0;
  for (std::size_t h = 0; h < static_cast<std::size_t>(hexes_); ++h) {
    double product2 = 1;
    for (std::size_t c : {1, 2, 3, 0}) {
      const double r2 = c > 0 ? (edge(h, c - 1) - d).squaredNorm() : product2;
      if (c > 0) product2 *= r2;
      const double D = determinant(static_cast<int>(h), static_cast<int>(c), d), fixed = constant_lengths(h, c);
      const double below2 = fixed * fixed * r2;
      if (D <= kFlat || below2 <= 0) return std::numeric_limits<double>::infinity();
      sum += raised(below2 / (D * D), energy.exponent);
    }
  }
  return sum + energy.shape_share * value(d, 0, energy.shape_exponent).energy;
}

// With s = 1/SJ^2: ln s = sum ln |r|^2 - 2 ln D. Its Hessian's negative part (along the edges r) is dropped.
void Star::angle_derivatives(const Vec3& d, const AngleEnergy& energy, Vec3& gradient, Mat3& hessian) const {
  derivatives(d, 0, energy.shape_exponent, gradient, hessian);
  gradient *= energy.shape_share;
  hessian *= energy.shape_share;
  const double k = energy.exponent;
  for (std::size_t h = 0; h < static_cast<std::size_t>(hexes_); ++h) {
    Vec3 sum = Vec3::Zero();
    Mat3 curve = Mat3::Zero();
    double product2 = 1;
    const auto add = [&](std::size_t c, const Vec3& edges, const Mat3& curvature, double length2) {
      const double D = determinant(static_cast<int>(h), static_cast<int>(c), d), fixed = constant_lengths(h, c);
      const Vec3 g(corners_.gx[c][h] / D, corners_.gy[c][h] / D, corners_.gz[c][h] / D);
      const Vec3 l = edges - 2 * g;
      const double kE = k * raised(fixed * fixed * length2 / (D * D), energy.exponent);
      gradient += kE * l;
      hessian += kE * (k * l * l.transpose() + 2 * g * g.transpose() + curvature);
    };
    for (std::size_t j = 0; j < 3; ++j) {
      const Vec3 r = edge(h, j) - d;
      const double r2 = r.squaredNorm();
      const Vec3 pull = -2 / r2 * r;
      const Mat3 bend = 2 / r2 * Mat3::Identity() - 2 / (r2 * r2) * r * r.transpose();
      sum += pull;
      curve += bend;
      product2 *= r2;
      add(1 + j, pull, bend, r2);
    }
    add(0, sum, curve, product2);
  }
}

}  // namespace strata
