// The geometry that held vertices stay on: projection by attachment. Immutable; any thread may ask.
#pragma once

#include <optional>
#include <vector>

#include "core/base/ids.h"
#include "core/base/vec3.h"
#include "core/features/features.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/polyline.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"

namespace strata {

struct Foothold {
  Vec3 position = Vec3::Zero();
  Vec3 direction = Vec3::Zero();   // chart: unit normal; curve: unit tangent; else zero
  std::int32_t hint = -1;  // triangle (chart) or segment (curve): pass back to the next question for speed; never changes answers
};

class Ground {
 public:
  // Surface and features must outlive the ground. Builds one locator per chart.
  Ground(const Surface& surface, const Features& features);

  // Closest place on what the attachment names; a chart of kWholeSurface is the whole surface. Free and Fixed: p itself.
  [[nodiscard]] Foothold project(const Attachment& attachment, const Vec3& p, std::int32_t hint = -1) const;
  // Closest place on the whole surface, whatever chart.
  [[nodiscard]] SurfacePoint closest(const Vec3& p, TriangleId hint = {}) const;

  // First hit of the ray p + s d, 0 < s <= limit, with the whole surface.
  [[nodiscard]] std::optional<Locator::Hit> first_hit(const Vec3& p, const Vec3& d, double limit) const {
    return whole_.first_hit(p, d, limit);
  }

  [[nodiscard]] const Surface& surface() const { return *surface_; }
  [[nodiscard]] const Features& features() const { return *features_; }

 private:
  const Surface* surface_;
  const Features* features_;
  Locator whole_;
  std::vector<Locator> charts_;  // by ChartId
  std::vector<Polyline> curves_;  // by CurveId
};

}  // namespace strata
