#include "core/base/context.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

namespace strata {
namespace {

TEST(Context, RecordsEveryStageItRan) {
  Context context;
  context.begin(Stage::Condition);
  context.begin(Stage::Carve);
  context.end();
  context.end();
  ASSERT_EQ(context.stages().size(), 2U);
  EXPECT_EQ(context.stages()[0].stage, Stage::Condition);
  EXPECT_EQ(context.stages()[1].stage, Stage::Carve);
  for (const StageRecord& record : context.stages()) {
    EXPECT_GE(record.seconds, 0);
    EXPECT_GE(record.cpu_seconds, 0);
    EXPECT_GT(record.peak_rss_bytes, 0);
  }
}

TEST(Context, TellsProgressThatOnlyRisesWithinAStage) {
  std::vector<Progress> told;
  Context context(nullptr, [&](const Progress& p) { told.push_back(p); });
  context.begin(Stage::GrowLayers);
  context.progress(0.8, 100);
  context.progress(0.3);
  context.progress(7);
  context.begin(Stage::MeasureQuality);
  ASSERT_EQ(told.size(), 5U);
  EXPECT_EQ(told[0].stage_fraction, 0);
  EXPECT_EQ(told[1].stage_fraction, 0.8);
  EXPECT_EQ(told[2].stage_fraction, 0.8);
  EXPECT_EQ(told[2].cells, 100) << "known cells stay known";
  EXPECT_EQ(told[3].stage_fraction, 1);
  EXPECT_EQ(told[4].stage, Stage::MeasureQuality);
  EXPECT_EQ(told[4].stage_fraction, 0) << "a stage starts at nothing";
}

TEST(Context, StopsAtTheNextCheckpointOnceCancelled) {
  std::atomic<bool> cancel = false;
  Context context(&cancel, {});
  context.begin(Stage::Condition);
  EXPECT_NO_THROW(context.checkpoint());
  EXPECT_FALSE(context.cancelled());
  cancel = true;
  EXPECT_TRUE(context.cancelled());
  for (const auto& step :
       {+[](Context& c) { c.checkpoint(); }, +[](Context& c) { c.progress(0.5); }, +[](Context& c) { c.begin(Stage::Carve); }})
    try {
      step(context);
      ADD_FAILURE() << "went on";
    } catch (const MeshError& error) {
      EXPECT_EQ(error.failure(), Failure::Cancelled);
      EXPECT_EQ(error.diagnostic().reason, Reason::Cancelled);
    }
}

TEST(Context, KeepsAdjustmentsAndTellsThem) {
  std::vector<std::string> told;
  Context context(nullptr, {}, [&](const Diagnostic& d) { told.push_back(d.message); });
  Diagnostic diagnostic;
  diagnostic.reason = Reason::LayersThinned;
  diagnostic.message = "thinner";
  context.adjusted(diagnostic);
  EXPECT_EQ(told, std::vector<std::string>{"thinner"});
  ASSERT_EQ(context.adjustments().size(), 1U);
  EXPECT_EQ(context.adjustments()[0].severity, Severity::Warning) << "the run goes on: no error";
}

TEST(Names, OfReasonsAndStagesAreDistinctAndWellFormed) {
  std::set<std::string_view> reasons, stages;
  const int last = static_cast<int>(Reason::InvariantViolated);
  for (int r = 0; r <= last; ++r) {
    const std::string_view name = reason_name(static_cast<Reason>(r));
    EXPECT_TRUE(std::all_of(name.begin(), name.end(), [](char c) { return (c >= 'A' && c <= 'Z') || c == '_'; })) << name;
    reasons.insert(name);
  }
  for (int s = 0; s < kStageCount; ++s) stages.insert(stage_name(static_cast<Stage>(s)));
  EXPECT_EQ(reasons.size(), static_cast<std::size_t>(last) + 1);
  EXPECT_EQ(stages.size(), static_cast<std::size_t>(kStageCount));
}

TEST(Context, AdjustmentsOfAnAttemptAreKeptBackUntilTheyAreTaken) {
  int told = 0;
  Context context(nullptr, {}, [&](const Diagnostic&) { ++told; });
  context.hold_adjustments();
  context.adjusted({});
  EXPECT_EQ(told, 0);
  EXPECT_TRUE(context.adjustments().empty());
  EXPECT_EQ(context.take_held_adjustments().size(), 1U);
  EXPECT_TRUE(context.take_held_adjustments().empty());
  context.adjusted({});
  EXPECT_EQ(told, 1);
  EXPECT_EQ(context.adjustments().size(), 1U);
}

}  // namespace
}  // namespace strata
