#include "core/features/merge_charts.h"

#include <algorithm>

namespace strata {

Features merge_charts(Features features, const IdMap<ChartId, ChartId>& into) {
  const auto image = [&](ChartId c) { return c.valid() ? into[c] : c; };
  for (ChartId& c : features.chart) c = image(c);
  for (Curve& curve : features.curves) {
    curve.left = image(curve.left);
    curve.right = image(curve.right);
  }
  for (Corner& corner : features.corners) {
    for (ChartAngle& angle : corner.charts) angle.chart = image(angle.chart);
    std::sort(corner.charts.begin(), corner.charts.end(),
              [](const ChartAngle& a, const ChartAngle& b) { return a.chart != b.chart ? a.chart < b.chart : a.angle < b.angle; });
    std::vector<ChartAngle> sums;
    for (const ChartAngle& angle : corner.charts) {
      if (sums.empty() || sums.back().chart != angle.chart) sums.push_back(angle);
      else sums.back().angle += angle.angle;
    }
    corner.charts = std::move(sums);
  }
  return features;
}

}  // namespace strata
