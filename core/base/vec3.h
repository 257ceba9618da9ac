// Points and vectors in double precision.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace strata {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

// Axis-aligned box. Empty (min > max) when default-made.
struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());

  void add(const Vec3& p) {
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  void add(const Box& b) {
    min = min.cwiseMin(b.min);
    max = max.cwiseMax(b.max);
  }
  [[nodiscard]] bool empty() const { return (min.array() > max.array()).any(); }
  [[nodiscard]] Vec3 centre() const { return 0.5 * (min + max); }
  [[nodiscard]] Vec3 extent() const { return max - min; }
  [[nodiscard]] double diagonal() const { return empty() ? 0.0 : extent().norm(); }
};

}  // namespace strata
