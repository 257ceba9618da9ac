#include "core/features/merge_charts.h"

#include <gtest/gtest.h>

#include "core/base/context.h"
#include "core/surface/surface.h"
#include "tests/support/shapes.h"

namespace strata {
namespace {

TEST(MergeCharts, MakesABorderACreaseInsideOneChart) {
  Context context;
  const Surface surface = condition(test::cube(2), context);
  const Features before = detect_features(surface, {}, context);
  ASSERT_EQ(before.chart_count(), 6U);
  const Curve& border = before.curves[CurveId(0)];
  IdMap<ChartId, ChartId> into(6);
  for (ChartId c : into.ids()) into[c] = c == border.right ? border.left : c;

  const Features after = merge_charts(before, into);
  EXPECT_EQ(after.curves[CurveId(0)].left, border.left);
  EXPECT_EQ(after.curves[CurveId(0)].right, border.left);
  for (TriangleId t : after.chart.ids()) EXPECT_EQ(after.chart[t], into[before.chart[t]]);
  for (CornerId c : after.corners.ids()) {
    double sum = 0, was = 0;
    for (const ChartAngle& a : after.corners[c].charts) sum += a.angle;
    for (const ChartAngle& a : before.corners[c].charts) was += a.angle;
    EXPECT_NEAR(sum, was, 1e-12);
    EXPECT_EQ(after.corners[c].angle_of(border.right), 0);
  }
}

}  // namespace
}  // namespace strata
