#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/mesh/hex.h"
#include "core/quality/quality.h"
#include "core/quality/validity.h"

namespace strata {
namespace {

using Corners = std::array<Vec3, 8>;

Corners brick(double a, double b, double c) {
  return {Vec3(0, 0, 0), Vec3(a, 0, 0), Vec3(a, b, 0), Vec3(0, b, 0), Vec3(0, 0, c), Vec3(a, 0, c), Vec3(a, b, c), Vec3(0, b, c)};
}

double determinant_at(const Corners& p, double x, double y, double z) {
  const auto mix = [](const Vec3& a, const Vec3& b, double t) -> Vec3 { return a + t * (b - a); };
  const Vec3 dx = mix(mix(p[1] - p[0], p[2] - p[3], y), mix(p[5] - p[4], p[6] - p[7], y), z);
  const Vec3 dy = mix(mix(p[3] - p[0], p[2] - p[1], x), mix(p[7] - p[4], p[6] - p[5], x), z);
  const Vec3 dz = mix(mix(p[4] - p[0], p[5] - p[1], x), mix(p[7] - p[3], p[6] - p[2], x), y);
  return dx.cross(dy).dot(dz);
}

double least_of_grid(const Corners& p, int n) {
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= n; ++k)
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) least = std::min(least, determinant_at(p, double(i) / n, double(j) / n, double(k) / n));
  return least;
}

Corners bent(std::mt19937& random, double amount) {
  std::uniform_real_distribution<double> noise(-amount, amount);
  Corners p = brick(1, 1, 1);
  for (Vec3& v : p) v += Vec3(noise(random), noise(random), noise(random));
  return p;
}

TEST(Bernstein, BricksArePositiveHoweverFlat) {
  EXPECT_TRUE(bernstein_positive(brick(1, 1, 1)));
  EXPECT_TRUE(bernstein_positive(brick(1, 1, 1e-7)));
  EXPECT_TRUE(bernstein_positive(brick(1e-5, 1e-5, 1e-9)));
}

TEST(Bernstein, HexesWithoutVolumeOrMirroredAreRefused) {
  EXPECT_FALSE(bernstein_positive(brick(1, 1, 0)));
  Corners p = brick(1, 1, 1);
  for (Vec3& v : p) v.x() = -v.x();
  EXPECT_FALSE(bernstein_positive(p));
}

TEST(Bernstein, AgreesWithDenseSampling) {
  std::mt19937 random(17);
  int positive = 0, negative = 0;
  for (int round = 0; round < 2000; ++round) {
    const Corners p = bent(random, 0.2 + 0.1 * (round % 5));
    const double least = least_of_grid(p, 12);
    if (bernstein_positive(p)) {
      ++positive;
      ASSERT_GT(least, 0) << "round " << round << ": a sample disproves the proof";
    } else {
      ++negative;
      // A refusal far from zero must be visible in samples; 1/12 apart they miss little of a determinant this smooth.
      ASSERT_LT(least, 0.02) << "round " << round << ": refused, but every sample is clearly positive";
    }
  }
  EXPECT_GT(positive, 200);
  EXPECT_GT(negative, 200);
}

TEST(Bernstein, SeesWhatCornersAndCentreDoNotShow) {
  std::mt19937 random(23);
  int hidden = 0;
  for (int round = 0; round < 20000; ++round) {
    const Corners p = bent(random, 0.45);
    if (scaled_jacobian(p) > 0 && !bernstein_positive(p)) ++hidden;
  }
  EXPECT_GT(hidden, 0) << "positive at nine points, negative elsewhere";
}

TEST(Bernstein, AcceptsWhatSamplesShowToBeClearlyPositive) {
  std::mt19937 random(29);
  int decided = 0;
  for (int round = 0; round < 5000; ++round) {
    const Corners p = bent(random, 0.4);
    const double least = least_of_grid(p, 8);
    if (least < 0.02) continue;
    EXPECT_TRUE(bernstein_positive(p)) << "round " << round << " with samples above " << least;
    ++decided;
  }
  EXPECT_GT(decided, 500);
}

TEST(Bernstein, DoesNotChangeUnderShiftScaleAndTurn) {
  std::mt19937 random(31);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int round = 0; round < 2000; ++round) {
    const Corners p = bent(random, 0.4);
    if (std::abs(least_of_grid(p, 8)) < 0.02) continue;  // too close to call once rounded
    Corners moved = p;
    const Eigen::AngleAxisd turn(3 * any(random), Vec3(any(random), any(random), any(random)).normalized());
    for (Vec3& v : moved) v = 1e-3 * (turn * v) + Vec3(5, -7, 11);
    EXPECT_EQ(bernstein_positive(p), bernstein_positive(moved)) << "round " << round;
  }
}

}  // namespace
}  // namespace strata
