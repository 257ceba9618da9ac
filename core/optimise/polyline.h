// Closest points on one polyline.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/vec3.h"

namespace strata {

class Polyline {
 public:
  struct Place {
    Vec3 position = Vec3::Zero();
    Vec3 tangent = Vec3::Zero();
    std::int32_t segment = -1;
    double distance2 = std::numeric_limits<double>::infinity();
  };

  Polyline() = default;
  // A closed polyline repeats its first point at the end. Segments of no length are tolerated.
  explicit Polyline(std::vector<Vec3> points);
  // `hint`: a segment probably near, for speed. Ties go to the smallest segment.
  [[nodiscard]] Place closest(const Vec3& p, std::int32_t hint = -1) const;

 private:
  [[nodiscard]] Place on_segment(std::int32_t segment, const Vec3& p) const;

  std::vector<Vec3> points_;
  std::vector<Box> runs_;  // boxes of kRun consecutive segments
};

}  // namespace strata
