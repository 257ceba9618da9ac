// The star of one vertex: the corners of its hexes that change when the vertex moves by `d`.
//
// Of each hex only the vertex's own corner and those of its three edge neighbours change. In all four, with the edge matrix A and the
// target W, T = A W^-1:   det T is affine in d:  D + g.d,   and |T|^2 an isotropic quadratic:  N + n.d + m |d|^2.
// So the star is gathered once, and every Newton step and every trial of the line search costs a few flops a corner.
//
//          d2--------*
//         /|        /|        v  the vertex
//       e2--------d1 |        e0 e1 e2  its edge neighbours, right-handed
//        | e0------|-d0       d0  between e0 and e1, d1 between e1 and e2, d2 between e2 and e0
//        |/        |/         *  plays no part
//        v--------e1          (mirror-drawn: e0 goes into the page, e1 right, e2 up)
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "core/base/vec3.h"
#include "core/mesh/hex.h"
#include "core/optimise/star_kernels.h"

namespace strata {

// For each corner of a hex: e0 e1 e2 d0 d1 d2 as above, and the hex axis along which e_k lies.
struct StarPattern {
  std::array<std::int8_t, 6> vertex{};
  std::array<std::int8_t, 3> axis{};
};
inline constexpr std::array<StarPattern, 8> kStarPatterns = [] {
  std::array<StarPattern, 8> patterns{};
  constexpr auto neighbour = [](std::size_t a, std::int8_t b) {
    for (const std::int8_t n : kHexCorners[a])
      if (n == b) return true;
    return false;
  };
  for (std::size_t c = 0; c < 8; ++c) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int8_t e = kHexCorners[c][k], next = kHexCorners[c][(k + 1) % 3];
      patterns[c].vertex[k] = e;
      for (std::int8_t d = 0; d < 8; ++d)
        if (static_cast<std::size_t>(d) != c && neighbour(static_cast<std::size_t>(e), d) && neighbour(static_cast<std::size_t>(next), d))
          patterns[c].vertex[3 + k] = d;
      for (std::size_t i = 0; i < 12; ++i) {
        const std::size_t a = kHexEdges[i][0], b = kHexEdges[i][1], end = static_cast<std::uint8_t>(e);
        if ((a == end && b == c) || (b == end && a == c)) patterns[c].axis[k] = static_cast<std::int8_t>(i / 4);
      }
    }
  }
  return patterns;
}();

// Energy of a corner: u^k with u = (|T|^2 / 3)^(3/2) / chi(det T), the mean-ratio shape energy to the power 3/2, which needs no cube root.
// chi(D) = (D + sqrt(eps^2 + D^2)) / 2, Garanzha et al. 2021, "Foldover-free maps in 50 lines of code". As |a||b||c| <= (|T|^2/3)^(3/2), a
// corner's scaled Jacobian is at least 1/u.
class Star {
 public:
  static constexpr int kMaxHexes = star_kernels::kMaxHexes;  // vertices with more are left where they are
  static constexpr double kFlat = 1e-12;  // determinants (targets: 1) up to here count as not positive: rounding, not volume

  void clear() {
    hexes_ = 0;
    all_sound_ = true;
  }
  // p: the vertex, then its six others in pattern order; w: inverse target lengths along e0 e1 e2; `sound`: the hex has only positive corners
  // and must keep them.
  void add_hex(const std::array<const Vec3*, 7>& p, const std::array<double, 3>& w, bool sound) {
    const auto h = static_cast<std::size_t>(hexes_++);
    for (std::size_t j = 0; j < 7; ++j) {
      points_.x[j][h] = p[j]->x();
      points_.y[j][h] = p[j]->y();
      points_.z[j][h] = p[j]->z();
    }
    for (std::size_t k = 0; k < 3; ++k) points_.w[k][h] = w[k];
    points_.freedom[h] = sound ? 0 : star_kernels::kFree;
    all_sound_ = all_sound_ && sound;
  }
  // After the last hex, before any question.
  void complete();

  [[nodiscard]] int hexes() const { return hexes_; }
  [[nodiscard]] bool all_sound() const { return all_sound_; }
  // Corner 0 of a hex is the vertex's own, 1 to 3 are those of e0 e1 e2.
  [[nodiscard]] double determinant(int hex, int corner, const Vec3& d) const {
    return corners_.D[corner][hex] + corners_.gx[corner][hex] * d.x() + corners_.gy[corner][hex] * d.y() + corners_.gz[corner][hex] * d.z();
  }
  [[nodiscard]] double least_determinant(const Vec3& d) const;
  // Mean length of the edges at the vertex, at d = 0.
  [[nodiscard]] double size() const { return size_; }

  struct Value {
    double energy = 0;
    double worst = 0;  // largest u
    bool sound = true;  // hexes that must stay sound have determinants above kFlat
  };
  [[nodiscard]] Value value(const Vec3& d, double eps, int exponent) const;
  // The value with its gradient and a positive definite Hessian: the exact one where eps = 0; without the curvature of chi (not convex)
  // otherwise. Not to be asked at places that are not sound.
  Value derivatives(const Vec3& d, double eps, int exponent, Vec3& gradient, Mat3& hessian) const;
  // Smallest scaled Jacobian of the corners.
  [[nodiscard]] double scaled_jacobian(const Vec3& d) const;

  // Energy for lifting the worst: the sum over corners of SJ^-2k + share u^j. Needs positive corners.
  struct AngleEnergy {
    int exponent = 1;  // k
    int shape_exponent = 1;  // j
    double shape_share = 0;
  };
  [[nodiscard]] double angle_energy(const Vec3& d, const AngleEnergy& energy) const;
  void angle_derivatives(const Vec3& d, const AngleEnergy& energy, Vec3& gradient, Mat3& hessian) const;

 private:
  // Of hex h: e_k - v, and the part of corner k's edge lengths that does not change (over det W^-1).
  [[nodiscard]] Vec3 edge(std::size_t h, std::size_t k) const;
  [[nodiscard]] double constant_lengths(std::size_t h, std::size_t corner) const;

  int hexes_ = 0;
  bool all_sound_ = true;
  double size_ = 0;
  star_kernels::Points points_;
  star_kernels::Corners corners_;
};

}  // namespace strata
