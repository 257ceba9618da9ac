// The one closest-point structure: a bounding-volume hierarchy over triangles of a surface. Immutable; any thread may ask.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/base/ids.h"
#include "core/base/vec3.h"
#include "core/surface/surface.h"

namespace strata {

struct SurfacePoint {
  Vec3 position = Vec3::Zero();
  TriangleId triangle;                    // invalid: nothing found within the bound
  double distance = std::numeric_limits<double>::infinity();
};

class Locator {
 public:
  // Over all triangles of the surface, which must outlive the locator. O(n log n).
  explicit Locator(const Surface& surface);
  // Over the given triangles only (a chart or a patch).
  Locator(const Surface& surface, std::vector<TriangleId> triangles);

  // Closest point within `bound` (else .triangle is invalid). `hint` is a triangle probably near: it tightens the search.
  // Ties go to the smallest triangle id, so that the answer does not depend on the hint.
  [[nodiscard]] SurfacePoint closest(const Vec3& p, double bound = std::numeric_limits<double>::infinity(), TriangleId hint = {}) const;
  // First hit of the ray p + s d, 0 < s <= limit (d need not be unit; s in units of |d|).
  struct Hit {
    double s;
    TriangleId triangle;
  };
  [[nodiscard]] std::optional<Hit> first_hit(const Vec3& p, const Vec3& d, double limit) const;
  // Generalised winding number (Jacobson et al. 2013), far clusters by dipoles (Barill et al. 2018). 1 inside a closed shell.
  [[nodiscard]] double winding_number(const Vec3& p) const;
  // Appends the triangles whose bounding boxes meet `box` (sorted by id).
  void overlapping(const Box& box, std::vector<TriangleId>& out) const;

 private:
  struct Node {
    Box box;
    std::int32_t first = 0;   // leaf: first triangle in order_; inner: left child (right child = first + 1)
    std::int32_t count = 0;   // leaf: number of triangles; inner: 0
    Vec3 dipole_centre = Vec3::Zero();
    Vec3 dipole = Vec3::Zero();  // sum of area vectors
    double radius = 0;
  };
  const Surface* surface_;
  std::vector<TriangleId> order_;
  std::vector<std::array<Vec3, 3>> corners_;  // of order_, side by side in memory: leaves are read in one go
  std::vector<Node> nodes_;
  std::vector<TriangleId> members_;           // sorted, when not all triangles of the surface: which hints may be used
};

}  // namespace strata
