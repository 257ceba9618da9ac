#include "core/finer_places.h"

#include <algorithm>

#include "tests/flow/flow.h"

namespace strata {
namespace {

bool tells(const Outcome& outcome, Reason reason) {
  return std::any_of(outcome.adjustments.begin(), outcome.adjustments.end(), [&](const Diagnostic& d) { return d.reason == reason; });
}

TEST(FinerPlaces, AChamferNarrowerThanTheCellsIsHeldBySmallerOnes) {
  for (const double chamfer : {0.05, 0.08}) {
    const Outcome outcome = testing::run(test::chamfered_cylinder(chamfer, 96), testing::sized(0.1));
    testing::expect_sound(outcome);
    EXPECT_EQ(outcome.rung, Rung::Full) << "chamfer of " << chamfer;
    EXPECT_TRUE(tells(outcome, Reason::SizeRefined));
    EXPECT_FALSE(tells(outcome, Reason::FeatureSoftened));
  }
}

TEST(FinerPlaces, AMinimumSizeIsKept) {
  MeshSpec spec = testing::sized(0.1);
  spec.sizing.min_size = 0.1;
  const Outcome outcome = testing::run(test::chamfered_cylinder(0.05, 96), spec);
  testing::expect_sound(outcome);
  EXPECT_FALSE(tells(outcome, Reason::SizeRefined));
  EXPECT_TRUE(tells(outcome, Reason::FeatureSoftened));
}

TEST(FinerPlaces, ASecondAttemptThatGoesWrongLeavesTheFirstMesh) {
  for (const Failure failure : {Failure::LimitExceeded, Failure::Internal, Failure::InvalidInput}) {
    int trees = 0;
    Observer observer;
    observer.on_estimate = [&](const Estimate&) {
      if (++trees > 1) throw MeshError(failure, Diagnostic{});
    };
    Context context;
    const Outcome outcome = generate(test::chamfered_cylinder(0.05, 96), testing::sized(0.1), context, observer);
    EXPECT_EQ(trees, 2);
    testing::expect_sound(outcome);
    EXPECT_TRUE(tells(outcome, Reason::FeatureSoftened));
    EXPECT_FALSE(tells(outcome, Reason::SizeRefined));
  }
}

TEST(FinerPlaces, NothingIsRefinedWhereNothingIsLost) {
  const Outcome outcome =
      testing::run(test::rotated(test::l_block(2), Vec3(1, 2, 3).normalized(), 0.4), testing::along_input(testing::sized(0.1)));
  EXPECT_EQ(outcome.rung, Rung::Full);
  EXPECT_FALSE(tells(outcome, Reason::SizeRefined));
}

TEST(FinerPlaces, MoreOfTheFeaturesIsBetterUnlessHexesBecomePoor) {
  const Merit lost{.lost = 0.2, .worst = 0.3}, held{.lost = 0, .worst = 0.25}, worthless{.lost = 0, .worst = 0.01};
  EXPECT_TRUE(is_better(held, lost));
  EXPECT_FALSE(is_better(lost, held));
  EXPECT_FALSE(is_better(worthless, lost));
  EXPECT_FALSE(is_better(held, held));
  EXPECT_TRUE(is_better({.lost = 0, .worst = 0.3}, held));
  EXPECT_TRUE(held.will_do());
  EXPECT_FALSE(lost.will_do());
  EXPECT_FALSE(worthless.will_do());
}

}  // namespace
}  // namespace strata
