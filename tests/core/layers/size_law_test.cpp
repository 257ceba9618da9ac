#include "core/layers/size_law.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace strata {
namespace {

std::vector<double> heights(const ColumnLaw& law, double thickness) {
  std::vector<double> level(static_cast<std::size_t>(law.count + law.blending));
  column_fractions(law, thickness, level);
  double before = 0;
  for (double& l : level) {
    const double at = l * thickness;
    l = at - before;
    before = at;
  }
  return level;
}

TEST(SizeLaw, KeepsThePhysicalHeightsWhileThereIsRoom) {
  const ColumnLaw law{0.01, 1.2, 4, 3, false};
  const std::vector<double> h = heights(law, 0.3);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(h[i], 0.01 * std::pow(1.2, i), 1e-12);
  for (std::size_t i = 4; i < 7; ++i) EXPECT_GT(h[i], h[i - 1]);
}

TEST(SizeLaw, BlendingRatiosAreEqual) {
  const ColumnLaw law{0.01, 1.2, 3, 4, false};
  const std::vector<double> h = heights(law, 0.4);
  const double q = h[3] / h[2];
  for (std::size_t i = 4; i < 7; ++i) EXPECT_NEAR(h[i] / h[i - 1], q, 1e-9);
}

TEST(SizeLaw, ShrinksAllHeightsByOneFactorWhereItIsTooThin) {
  const ColumnLaw law{0.01, 1.2, 4, 0, false};
  const std::vector<double> h = heights(law, 0.5 * physical_thickness(law));
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(h[i], 0.005 * std::pow(1.2, i), 1e-12);
}

TEST(SizeLaw, GivesUpGrowthFirstWhenTold) {
  const ColumnLaw law{0.01, 1.5, 4, 0, true};
  const std::vector<double> h = heights(law, 0.06);
  EXPECT_NEAR(h[0], 0.01, 1e-9);
  EXPECT_NEAR(h[3] / h[2], h[1] / h[0], 1e-9);
  const std::vector<double> thinner = heights(law, 0.02);
  for (double x : thinner) EXPECT_NEAR(x, 0.005, 1e-9);
}

TEST(SizeLaw, TheCountThatFitsLeavesRoomInNearlyAllColumns) {
  const ColumnLaw law{0.01, 1.2, 8, 0, false};
  const auto thickness_of = [&](int count) {
    ColumnLaw less = law;
    less.count = count;
    return physical_thickness(less);
  };
  std::vector<ColumnLaw> laws(100, law);
  std::vector<double> room(100, 1.0);
  EXPECT_EQ(count_that_fits(laws, room, 1, 0.95), 8);
  std::fill_n(room.begin(), 5, 0.5 * law.first_height);  // few enough
  EXPECT_EQ(count_that_fits(laws, room, 1, 0.95), 8);
  room[5] = 1.001 * thickness_of(3);
  EXPECT_EQ(count_that_fits(laws, room, 1, 0.95), 3);
  EXPECT_EQ(count_that_fits(laws, room, 5, 0.95), 5);
  std::fill(room.begin(), room.end(), 0.5 * law.first_height);
  EXPECT_EQ(count_that_fits(laws, room, 1, 0.95), 1);
  EXPECT_EQ(count_that_fits({}, {}, 2, 0.95), 2);
}

TEST(SizeLaw, LevelsRiseAndEndAtOne) {
  for (int count : {1, 2, 7})
    for (int blending : {0, 1, 5})
      for (double thickness : {1e-4, 0.01, 0.05, 1.0}) {
        std::vector<double> level(static_cast<std::size_t>(count + blending));
        column_fractions({0.004, 1.3, count, blending, false}, thickness, level);
        double before = 0;
        for (double l : level) {
          EXPECT_GT(l, before);
          before = l;
        }
        EXPECT_EQ(level.back(), 1);
      }
}

TEST(SizeLaw, BlendingLeadsToHalfTheSize) {
  EXPECT_EQ(blending_layers({0.6, 1, 1, 0, false}, 1.0), 0);
  EXPECT_EQ(blending_layers({0.4, 1, 1, 0, false}, 1.0), 1);
  EXPECT_GT(blending_layers({0.001, 1.2, 5, 0, false}, 1.0), 8);
}

}  // namespace
}  // namespace strata
