#include "core/optimise/star.h"

#include <algorithm>
#include <limits>

namespace strata {
namespace {

constexpr double kNorm = 0.19245008972987526;  // 3^(-3/2): u = 1 for the ideal corner
constexpr double kShapeShare = 1e-3;           // of the shape energy in the angle energy: decides only where angles do not

}  // namespace

void Star::add_hex(const std::array<Vec3, 7>& p, const Vec3& w, bool sound) {
  const int h = hexes_++;
  if (h == 0) size_ = 0;
  const double W = w.x() * w.y() * w.z();
  const std::array<double, 3> w2{w.x() * w.x(), w.y() * w.y(), w.z() * w.z()};
  std::array<Vec3, 3> r;
  std::array<double, 3> r2;
  for (std::size_t k = 0; k < 3; ++k) {
    r[k] = p[k + 1] - p[0];
    r2[k] = r[k].squaredNorm();
    edge_[static_cast<std::size_t>(3 * h) + k] = r[k];
    size_ += std::sqrt(r2[k]);
  }
  const auto put = [&](std::size_t c, double D, const Vec3& g, double N, const Vec3& n, double m, double fixed) {
    D_[c] = D;
    gx_[c] = g.x(), gy_[c] = g.y(), gz_[c] = g.z();
    N_[c] = N;
    nx_[c] = n.x(), ny_[c] = n.y(), nz_[c] = n.z();
    m_[c] = m;
    fixed_[c] = fixed;
    sound_[c] = sound ? 1 : 0;
  };
  const auto c0 = static_cast<std::size_t>(4 * h);
  const Vec3 n_own = -2 * (w2[0] * r[0] + w2[1] * r[1] + w2[2] * r[2]);
  put(c0, W * r[0].cross(r[1]).dot(r[2]), -W * (r[1] - r[0]).cross(r[2] - r[0]), w2[0] * r2[0] + w2[1] * r2[1] + w2[2] * r2[2], n_own,
      w2[0] + w2[1] + w2[2], W);
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    const Vec3 a = p[4 + k] - p[1 + k];    // along axis k1
    const Vec3 b = p[4 + k2] - p[1 + k];   // along axis k2
    const Vec3 area = W * a.cross(b);
    const double a2 = a.squaredNorm(), b2 = b.squaredNorm();
    put(c0 + 1 + k, area.dot(r[k]), -area, w2[k] * r2[k] + w2[k1] * a2 + w2[k2] * b2, -2 * w2[k] * r[k], w2[k], W * std::sqrt(a2 * b2));
  }
}

bool Star::all_sound() const {
  for (int c = 0; c < corners(); c += 4)
    if (sound_[static_cast<std::size_t>(c)] == 0) return false;
  return true;
}

double Star::least_determinant(const Vec3& d) const {
  double least = std::numeric_limits<double>::infinity();
  for (int c = 0; c < corners(); ++c) least = std::min(least, determinant(c, d));
  return least;
}

Star::Value Star::value(const Vec3& d, double eps, int exponent) const {
  Value v;
  const double x = d.x(), y = d.y(), z = d.z(), dd = d.squaredNorm(), eps2 = eps * eps;
  for (std::size_t c = 0; c < static_cast<std::size_t>(corners()); ++c) {
    const double D = D_[c] + gx_[c] * x + gy_[c] * y + gz_[c] * z;
    const double N = std::max(N_[c] + nx_[c] * x + ny_[c] * y + nz_[c] * z + m_[c] * dd, 0.0);
    if (D <= kFlat && sound_[c] != 0) {
      v.sound = false;
      v.energy = v.worst = std::numeric_limits<double>::infinity();
      return v;
    }
    double chi = D;
    if (eps2 > 0) {
      const double s = std::sqrt(eps2 + D * D);
      chi = D > 0 ? 0.5 * (D + s) : 0.5 * eps2 / (s - D);  // the second form does not cancel
    }
    const double u = kNorm * N * std::sqrt(N) / chi;
    v.worst = std::max(v.worst, u);
    v.energy += raised(u, exponent);
  }
  return v;
}

Star::Value Star::derivatives(const Vec3& d, double eps, int exponent, Vec3& gradient, Mat3& hessian) const {
  const double x = d.x(), y = d.y(), z = d.z(), dd = d.squaredNorm(), eps2 = eps * eps, k = exponent;
  double Gx = 0, Gy = 0, Gz = 0, Hxx = 0, Hyy = 0, Hzz = 0, Hxy = 0, Hxz = 0, Hyz = 0;
  Value v;
  for (std::size_t c = 0; c < static_cast<std::size_t>(corners()); ++c) {
    const double D = D_[c] + gx_[c] * x + gy_[c] * y + gz_[c] * z;
    const double N = std::max(N_[c] + nx_[c] * x + ny_[c] * y + nz_[c] * z + m_[c] * dd, 1e-300);
    const double s = eps2 > 0 ? std::sqrt(eps2 + D * D) : D, r = 1 / s;  // chi' / chi = 1 / s
    const double i_chi = D > 0 ? (eps2 > 0 ? 2 / (D + s) : r) : 2 * (s - D) / eps2;
    const double u = kNorm * N * std::sqrt(N) * i_chi;
    const double E = raised(u, exponent), kE = k * E;
    v.worst = std::max(v.worst, u);
    v.energy += E;
    // a = grad ln N, b = grad ln chi, l = grad ln u = 3/2 a - b
    const double iN = 1 / N, m2 = 2 * m_[c];
    const double ax = (nx_[c] + m2 * x) * iN, ay = (ny_[c] + m2 * y) * iN, az = (nz_[c] + m2 * z) * iN;
    const double bx = gx_[c] * r, by = gy_[c] * r, bz = gz_[c] * r;
    const double lx = 1.5 * ax - bx, ly = 1.5 * ay - by, lz = 1.5 * az - bz;
    Gx += kE * lx, Gy += kE * ly, Gz += kE * lz;
    const double iso = 1.5 * m2 * iN, klx = k * lx, kly = k * ly, klz = k * lz, tx = 1.5 * ax, ty = 1.5 * ay, tz = 1.5 * az;
    Hxx += kE * (klx * lx - tx * ax + bx * bx + iso);
    Hyy += kE * (kly * ly - ty * ay + by * by + iso);
    Hzz += kE * (klz * lz - tz * az + bz * bz + iso);
    Hxy += kE * (klx * ly - tx * ay + bx * by);
    Hxz += kE * (klx * lz - tx * az + bx * bz);
    Hyz += kE * (kly * lz - ty * az + by * bz);
  }
  gradient = Vec3(Gx, Gy, Gz);
  hessian << Hxx, Hxy, Hxz, Hxy, Hyy, Hyz, Hxz, Hyz, Hzz;
  return v;
}

double Star::scaled_jacobian(const Vec3& d) const {
  double least = 1;
  for (std::size_t h = 0; h < static_cast<std::size_t>(hexes_); ++h) {
    double product2 = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const double r2 = (edge_[3 * h + k] - d).squaredNorm();
      product2 *= r2;
      const double below = fixed_[4 * h + 1 + k] * std::sqrt(r2);
      least = std::min(least, below > 0 ? determinant(static_cast<int>(4 * h + 1 + k), d) / below : 0.0);
    }
    const double below = fixed_[4 * h] * std::sqrt(product2);
    least = std::min(least, below > 0 ? determinant(static_cast<int>(4 * h), d) / below : 0.0);
  }
  return least;
}

double Star::angle_energy(const Vec3& d, int exponent) const {
  double sum = 0;
  const auto add = [&](double D, double below2) {
    if (D <= kFlat || below2 <= 0) return false;
    sum += raised(below2 / (D * D), exponent);
    return true;
  };
  for (std::size_t h = 0; h < static_cast<std::size_t>(hexes_); ++h) {
    double product2 = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t c = 4 * h + 1 + k;
      const double r2 = (edge_[3 * h + k] - d).squaredNorm();
      product2 *= r2;
      if (!add(determinant(static_cast<int>(c), d), fixed_[c] * fixed_[c] * r2)) return std::numeric_limits<double>::infinity();
    }
    const std::size_t c = 4 * h;
    if (!add(determinant(static_cast<int>(c), d), fixed_[c] * fixed_[c] * product2)) return std::numeric_limits<double>::infinity();
  }
  return sum + kShapeShare * value(d, 0, exponent).energy;
}

// With s = 1/SJ^2: ln s = sum ln |r|^2 - 2 ln D. Its Hessian's negative part (along the edges r) is dropped.
void Star::angle_derivatives(const Vec3& d, int exponent, Vec3& gradient, Mat3& hessian) const {
  derivatives(d, 0, exponent, gradient, hessian);
  gradient *= kShapeShare;
  hessian *= kShapeShare;
  const double k = exponent;
  for (std::size_t h = 0; h < static_cast<std::size_t>(hexes_); ++h) {
    Vec3 sum = Vec3::Zero();
    Mat3 curve = Mat3::Zero();
    double product2 = 1;
    const auto add = [&](std::size_t c, const Vec3& edges, const Mat3& curvature, double length2) {
      const double D = determinant(static_cast<int>(c), d);
      const Vec3 g(gx_[c] / D, gy_[c] / D, gz_[c] / D);
      const Vec3 l = edges - 2 * g;
      const double kE = k * raised(fixed_[c] * fixed_[c] * length2 / (D * D), exponent);
      gradient += kE * l;
      hessian += kE * (k * l * l.transpose() + 2 * g * g.transpose() + curvature);
    };
    for (std::size_t j = 0; j < 3; ++j) {
      const Vec3 r = edge_[3 * h + j] - d;
      const double r2 = r.squaredNorm();
      const Vec3 pull = -2 / r2 * r;
      const Mat3 bend = 2 / r2 * Mat3::Identity() - 2 / (r2 * r2) * r * r.transpose();
      sum += pull;
      curve += bend;
      product2 *= r2;
      add(4 * h + 1 + j, pull, bend, r2);
    }
    add(4 * h, sum, curve, product2);
  }
}

}  // namespace strata
