#include "core/optimise/polyline.h"

#include <algorithm>

namespace strata {
namespace {

constexpr std::int32_t kRun = 16;  // segments a box; a curve of 10,000 segments costs some 600 box tests a question

double distance2(const Box& box, const Vec3& p) { return (box.min - p).cwiseMax(p - box.max).cwiseMax(0.0).squaredNorm(); }

}  // namespace

Polyline::Polyline(std::vector<Vec3> points) : points_(std::move(points)) {
  const auto segments = static_cast<std::int32_t>(points_.size()) - 1;
  for (std::int32_t first = 0; first < segments; first += kRun) {
    Box box;
    for (std::int32_t i = first; i <= std::min(first + kRun, segments); ++i) box.add(points_[static_cast<std::size_t>(i)]);
    runs_.push_back(box);
  }
}

Polyline::Place Polyline::on_segment(std::int32_t segment, const Vec3& p) const {
  const Vec3& a = points_[static_cast<std::size_t>(segment)];
  const Vec3& b = points_[static_cast<std::size_t>(segment) + 1];
  const Vec3 d = b - a;
  const double length2 = d.squaredNorm();
  const double t = length2 > 0 ? std::clamp(d.dot(p - a) / length2, 0.0, 1.0) : 0.0;
  Place place;
  place.position = t == 1.0 ? b : Vec3(a + t * d);
  place.tangent = length2 > 0 ? Vec3(d / std::sqrt(length2)) : Vec3::Zero();
  place.segment = segment;
  place.distance2 = (place.position - p).squaredNorm();
  return place;
}

Polyline::Place Polyline::closest(const Vec3& p, std::int32_t hint) const {
  const auto segments = static_cast<std::int32_t>(points_.size()) - 1;
  Place best;
  if (segments < 1) {
    if (!points_.empty()) best.position = points_[0];
    return best;
  }
  if (hint >= 0 && hint < segments) best = on_segment(hint, p);
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    if (distance2(runs_[r], p) > best.distance2) continue;
    const auto first = static_cast<std::int32_t>(r) * kRun;
    for (std::int32_t s = first; s < std::min(first + kRun, segments); ++s) {
      const Place place = on_segment(s, p);
      if (place.distance2 < best.distance2 || (place.distance2 == best.distance2 && s < best.segment)) best = place;
    }
  }
  return best;
}

}  // namespace strata
