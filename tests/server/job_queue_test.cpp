// Who runs next.
#include "server/job_queue.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace strata::server {
namespace {

const auto anybody = [](const std::string&) { return true; };

std::vector<std::string> drained(JobQueue& queue) {
  std::vector<std::string> order;
  while (const auto id = queue.pop(anybody)) order.push_back(*id);
  return order;
}

TEST(JobQueue, RunsOneTenantsJobsInTheOrderTheyCame) {
  JobQueue queue;
  for (const char* id : {"a", "b", "c"}) queue.push(id, "t", 0, 1);
  EXPECT_EQ(queue.ahead_of("c"), 2);
  EXPECT_EQ(drained(queue), (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_EQ(queue.size(), 0u);
}

TEST(JobQueue, PrefersPriorityUntilTheOthersHaveWaitedLongEnough) {
  JobQueue queue;
  queue.push("old", "t", 0, 0);
  queue.push("urgent", "t", 1, JobQueue::kSecondsPerPriority - 1);
  queue.push("late", "t", 1, JobQueue::kSecondsPerPriority + 1);
  EXPECT_EQ(drained(queue), (std::vector<std::string>{"urgent", "old", "late"}));
}

TEST(JobQueue, SharesTheCoresByWeightWhoeverSubmitsMost) {
  JobQueue queue;
  for (int i = 0; i < 300; ++i) queue.push("many" + std::to_string(i), "many", 0, i);
  for (int i = 0; i < 300; ++i) queue.push("few" + std::to_string(i), "few", 0, i);
  int many = 0;
  for (int i = 0; i < 90; ++i) {
    const std::string id = *queue.pop(anybody);
    const bool is_many = id.rfind("many", 0) == 0;
    many += is_many ? 1 : 0;
    // Jobs of the first tenant cost twice as much, and the second has twice the weight: four jobs to one.
    queue.charge(is_many ? "many" : "few", is_many ? 20 : 10, is_many ? 1 : 2);
  }
  EXPECT_NEAR(many, 18, 1);
}

TEST(JobQueue, GivesNoCreditForTimeNotUsed) {
  JobQueue queue;
  for (int i = 0; i < 10; ++i) queue.push("a" + std::to_string(i), "a", 0, i);
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(queue.pop(anybody));
    queue.charge("a", 100, 1);
  }
  for (int i = 0; i < 10; ++i) queue.push("b" + std::to_string(i), "b", 0, 100 + i);
  int late = 0;
  for (int i = 0; i < 6; ++i) {
    const bool is_b = queue.pop(anybody)->front() == 'b';
    queue.charge(is_b ? "b" : "a", 100, 1);
    late += is_b ? 1 : 0;
  }
  EXPECT_LE(late, 4);
}

TEST(JobQueue, PassesOverTenantsThatMayNotRunMore) {
  JobQueue queue;
  queue.push("a", "full", 10, 0);
  queue.push("b", "free", 0, 5);
  EXPECT_EQ(queue.pop([](const std::string& tenant) { return tenant != "full"; }), "b");
  EXPECT_FALSE(queue.pop([](const std::string& tenant) { return tenant != "full"; }));
  EXPECT_EQ(queue.size_of("full"), 1u);
}

TEST(JobQueue, ForgetsWhatIsRemoved) {
  JobQueue queue;
  queue.push("a", "t", 0, 0);
  queue.push("b", "t", 0, 1);
  EXPECT_TRUE(queue.remove("a"));
  EXPECT_FALSE(queue.remove("a"));
  EXPECT_FALSE(queue.holds("a"));
  EXPECT_EQ(queue.ahead_of("b"), 0);
}

}  // namespace
}  // namespace strata::server
