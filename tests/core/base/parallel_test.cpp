#include "core/base/parallel.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <cmath>
#include <random>

#include "core/base/ids.h"
#include "core/base/vec3.h"

namespace strata {
namespace {

TEST(ParallelFor, VisitsEveryIndexOnce) {
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, kGrain - 1, kGrain, kGrain + 1, 5 * kGrain + 7}) {
    std::vector<int> visits(count, 0);
    parallel_for(count, [&](std::size_t i) { ++visits[i]; });
    EXPECT_EQ(std::count(visits.begin(), visits.end(), 1), static_cast<std::ptrdiff_t>(count));
  }
}

TEST(ParallelReduce, GivesTheSameBitsForAnyNumberOfThreads) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  std::vector<double> values(100003);
  for (double& v : values) v = any(random) * std::pow(10, 8 * any(random));
  const auto sum = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return parallel_reduce(values.size(), 0.0, [&](std::size_t i) { return values[i]; }, std::plus<>());
  };
  const double one = sum(1);
  for (int round = 0; round < 10; ++round)
    for (const std::size_t threads : {2, 3, 8}) EXPECT_EQ(sum(threads), one);
}

TEST(ParallelReduce, OfNothingIsTheIdentity) {
  EXPECT_EQ(parallel_reduce(0, 42, [](std::size_t) { return 1; }, std::plus<>()), 42);
}

TEST(ExclusiveScan, TurnsCountsIntoOffsets) {
  std::vector<int> counts{3, 0, 2, 5};
  EXPECT_EQ(exclusive_scan(counts), 10);
  EXPECT_EQ(counts, (std::vector<int>{0, 3, 3, 5}));
}

TEST(IdMap, IsIndexedByItsIdsInOrder) {
  IdMap<VertexId, int> map(3, 7);
  EXPECT_EQ(map.next_id(), VertexId(3));
  EXPECT_EQ(map.push_back(9), VertexId(3));
  int sum = 0;
  std::int32_t next = 0;
  for (VertexId v : map.ids()) {
    EXPECT_EQ(v.value, next++);
    sum += map[v];
  }
  EXPECT_EQ(sum, 30);
  EXPECT_FALSE(VertexId().valid());
  EXPECT_TRUE(VertexId(0).valid());
}

TEST(Box, GrowsFromNothing) {
  Box box;
  EXPECT_TRUE(box.empty());
  EXPECT_EQ(box.diagonal(), 0);
  box.add(Vec3(1, 2, 3));
  EXPECT_FALSE(box.empty());
  EXPECT_EQ(box.diagonal(), 0);
  box.add(Vec3(-1, 0, 2));
  EXPECT_EQ(box.centre(), Vec3(0, 1, 2.5));
  EXPECT_EQ(box.diagonal(), 3);
}

}  // namespace
}  // namespace strata
