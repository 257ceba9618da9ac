#include "core/octree/triangle_box.h"

#include <algorithm>

namespace strata {

TriangleAxes::TriangleAxes(const std::array<Vec3, 3>& corners) {
  std::size_t n = 0;
  axis_[n++] = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3 e = corners[(i + 1) % 3] - corners[i];
    axis_[n++] = Vec3(0, -e.z(), e.y());
    axis_[n++] = Vec3(e.z(), 0, -e.x());
    axis_[n++] = Vec3(-e.y(), e.x(), 0);
  }
  for (std::size_t k = 0; k < kAxes; ++k) {
    const auto [low, high] = std::minmax({axis_[k].dot(corners[0]), axis_[k].dot(corners[1]), axis_[k].dot(corners[2])});
    low_[k] = low;
    high_[k] = high;
    reach_[k] = axis_[k].lpNorm<1>();
  }
}

bool TriangleAxes::separate(const Vec3& centre, double half_edge) const {
  for (std::size_t k = 0; k < kAxes; ++k) {
    const double at = axis_[k].dot(centre);
    const double reach = half_edge * reach_[k];
    if (at - reach > high_[k] || at + reach < low_[k]) return true;
  }
  return false;
}

}  // namespace strata
