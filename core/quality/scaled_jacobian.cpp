#include <algorithm>
#include <cmath>

#include "core/mesh/hex.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

// Triple product of the directions; 0 where an axis has no length, as Verdict says.
double scaled_determinant(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double lengths = std::sqrt(a.squaredNorm() * b.squaredNorm() * c.squaredNorm());
  return lengths > 0 ? a.cross(b).dot(c) / lengths : 0;
}

}  // namespace

double corner_scaled_jacobian(const std::array<Vec3, 8>& p) {
  double least = 1;
  for (std::size_t i = 0; i < 8; ++i) {
    const auto& n = kHexCorners[i];
    const auto edge = [&](std::size_t k) -> Vec3 { return p[static_cast<std::size_t>(n[k])] - p[i]; };
    least = std::min(least, scaled_determinant(edge(0), edge(1), edge(2)));
  }
  return least;
}

// scaled Jacobian, Verdict SAND2007-1751: corners and, by the principal axes, the centre
double scaled_jacobian(const std::array<Vec3, 8>& p) {
  const Vec3 x = p[1] - p[0] + p[2] - p[3] + p[5] - p[4] + p[6] - p[7];
  const Vec3 y = p[3] - p[0] + p[2] - p[1] + p[7] - p[4] + p[6] - p[5];
  const Vec3 z = p[4] - p[0] + p[5] - p[1] + p[6] - p[2] + p[7] - p[3];
  return std::min(corner_scaled_jacobian(p), scaled_determinant(x, y, z));
}

}  // namespace strata
