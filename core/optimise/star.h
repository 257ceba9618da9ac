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
        const auto a = kHexEdges[i][0], b = kHexEdges[i][1];
        if ((a == e && static_cast<std::size_t>(b) == c) || (b == e && static_cast<std::size_t>(a) == c))
          patterns[c].axis[k] = static_cast<std::int8_t>(i / 4);
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
  static constexpr int kMaxHexes = 48;  // vertices with more are left where they are
  static constexpr int kMaxCorners = 4 * kMaxHexes;
  static constexpr double kFlat = 1e-12;  // determinants (targets: 1) up to here count as not positive: rounding, not volume

  void clear() { hexes_ = 0; }
  // p: the vertex, then its six others in pattern order; w: inverse target lengths along e0 e1 e2; `sound`: the hex has only positive corners
  // and must keep them.
  void add_hex(const std::array<Vec3, 7>& p, const Vec3& w, bool sound);

  [[nodiscard]] int hexes() const { return hexes_; }
  [[nodiscard]] int corners() const { return 4 * hexes_; }
  [[nodiscard]] bool all_sound() const;
  [[nodiscard]] double determinant(int corner, const Vec3& d) const {
    return D_[corner] + gx_[corner] * d.x() + gy_[corner] * d.y() + gz_[corner] * d.z();
  }
  [[nodiscard]] double least_determinant(const Vec3& d) const;
  // Mean length of the edges at the vertex, at d = 0.
  [[nodiscard]] double size() const { return size_ / (3 * hexes_); }

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

  // Energy sum of SJ^-2k plus a little shape energy, which keeps edges from collapsing: for lifting the worst. Needs positive corners.
  [[nodiscard]] double angle_energy(const Vec3& d, int exponent) const;
  void angle_derivatives(const Vec3& d, int exponent, Vec3& gradient, Mat3& hessian) const;

 private:
  [[nodiscard]] double raised(double u, int exponent) const {
    double r = u;
    for (int i = 1; i < exponent; ++i) r *= u;
    return r;
  }
  int hexes_ = 0;
  double size_ = 0;
  std::array<double, kMaxCorners> D_, gx_, gy_, gz_, N_, nx_, ny_, nz_, m_;
  std::array<std::uint8_t, kMaxCorners> sound_;
  std::array<double, kMaxCorners> fixed_;  // product of the corner's constant edge lengths over det W^-1
  std::array<Vec3, 3 * kMaxHexes> edge_;  // e_k - v
};

}  // namespace strata
