// Does a triangle meet a cube? Separating axes of the pair, prepared once per triangle and asked for many cubes.
#pragma once

#include <array>

#include "core/base/vec3.h"

namespace strata {

// The ten directions that boxes' faces do not cover: the triangle's normal, and its edges crossed with x, y and z (Akenine-Moller,
// "Fast 3D Triangle-Box Overlap Testing", 2001). The three face directions are the bounding boxes' business: test those first.
class TriangleAxes {
 public:
  explicit TriangleAxes(const std::array<Vec3, 3>& corners);
  // True only if a direction separates the triangle from the cube. Rounding errs within about 1e-15 of the coordinates: inflate.
  [[nodiscard]] bool separate(const Vec3& centre, double half_edge) const;

 private:
  static constexpr std::size_t kAxes = 10;
  std::array<Vec3, kAxes> axis_;
  std::array<double, kAxes> low_, high_;  // the triangle's interval
  std::array<double, kAxes> reach_;       // half interval of a cube of half edge 1
};

}  // namespace strata
