#include "core/optimise/ground.h"

#include <utility>

namespace strata {
namespace {

std::vector<Locator> locators_of_charts(const Surface& surface, const Features& features) {
  std::vector<std::vector<TriangleId>> triangles(features.chart_count());
  for (const TriangleId t : features.chart.ids())
    if (features.chart[t].valid()) triangles[features.chart[t].index()].push_back(t);
  std::vector<Locator> charts;
  charts.reserve(triangles.size());
  for (auto& of_chart : triangles) charts.emplace_back(surface, std::move(of_chart));
  return charts;
}

std::vector<Polyline> polylines_of_curves(const Surface& surface, const Features& features) {
  std::vector<Polyline> curves;
  curves.reserve(features.curves.size());
  for (const Curve& curve : features.curves) {
    std::vector<Vec3> points;
    points.reserve(curve.points.size() + 1);
    for (const PointId p : curve.points) points.push_back(surface.points[p]);
    if (curve.closed && !points.empty()) points.push_back(points.front());
    curves.emplace_back(std::move(points));
  }
  return curves;
}

}  // namespace

Ground::Ground(const Surface& surface, const Features& features)
    : surface_(&surface),
      features_(&features),
      whole_(surface),
      charts_(locators_of_charts(surface, features)),
      curves_(polylines_of_curves(surface, features)) {}

SurfacePoint Ground::closest(const Vec3& p, TriangleId hint) const {
  return whole_.closest(p, std::numeric_limits<double>::infinity(), hint);
}

Foothold Ground::project(const Attachment& attachment, const Vec3& p, std::int32_t hint) const {
  switch (attachment.hold) {
    case Hold::Chart: {
      const Locator& locator = attachment.of == kWholeSurface ? whole_ : charts_[static_cast<std::size_t>(attachment.of)];
      const SurfacePoint at = locator.closest(p, std::numeric_limits<double>::infinity(), TriangleId(hint));
      if (!at.triangle.valid()) return {p, Vec3::Zero(), -1};  // an empty chart holds nobody
      return {at.position, surface_->normal[at.triangle], at.triangle.value};
    }
    case Hold::Curve: {
      const Polyline::Place at = curves_[static_cast<std::size_t>(attachment.of)].closest(p, hint);
      return {at.position, at.tangent, at.segment};
    }
    case Hold::Corner: {
      const CornerId corner(attachment.of);
      return {surface_->points[features_->corners[corner].point], Vec3::Zero(), -1};
    }
    case Hold::Free:
    case Hold::Fixed: break;
  }
  return {p, Vec3::Zero(), -1};
}

}  // namespace strata
