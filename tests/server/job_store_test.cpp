// One contract for every store of jobs.
#include <gtest/gtest.h>
#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/job_store.h"
#include "tests/server/store_fixture.h"

namespace strata::server {
namespace {

class JobStores : public testing::TestWithParam<bool> {
 protected:
  [[nodiscard]] std::unique_ptr<JobStore> open() const { return GetParam() ? open_job_store(folder_.path()) : make_memory_job_store(); }

  static StoredJob stored(const std::string& request_id = {}) {
    StoredJob result;
    result.job.set_job_id(random_id());
    result.job.set_state(v1::JOB_STATE_QUEUED);
    result.job.mutable_quality()->set_vertices(8);
    result.request.set_request_id(request_id);
    result.fingerprint = "print";
    return result;
  }
  static v1::WatchJobResponse event(std::int64_t sequence) {
    v1::WatchJobResponse result;
    result.set_sequence(sequence);
    result.mutable_heartbeat();
    return result;
  }

  Folder folder_;
};

TEST_P(JobStores, FindByIdAndByRequest) {
  const auto store = open();
  const StoredJob one = stored("r1"), two = stored();
  EXPECT_TRUE(store->insert(one, event(1)));
  EXPECT_TRUE(store->insert(two, event(1)));
  EXPECT_EQ(store->count(), 2);
  EXPECT_EQ(store->find_request("", "r1")->job.job_id(), one.job.job_id());
  EXPECT_FALSE(store->find_request("", "r2"));
  EXPECT_EQ(store->find(two.job.job_id())->fingerprint, "print");
  EXPECT_FALSE(store->find(random_id()));
  EXPECT_EQ(store->unfinished().front().job.job_id(), one.job.job_id());
}

TEST_P(JobStores, EventsFollowASequence) {
  const auto store = open();
  StoredJob job = stored();
  EXPECT_TRUE(store->insert(job, event(1)));
  job.job.set_state(v1::JOB_STATE_RUNNING);
  store->update(job.job, {event(2), event(5)});
  EXPECT_EQ(store->find(job.job.job_id())->job.state(), v1::JOB_STATE_RUNNING);
  const auto events = store->events(job.job.job_id(), 1);
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[1].sequence(), 5);
}

TEST_P(JobStores, ListIsPagedNewestFirstWithoutDetails) {
  const auto store = open();
  std::vector<std::string> ids;
  for (int i = 0; i < 5; ++i) {
    StoredJob job = stored();
    if (i == 2) job.job.set_state(v1::JOB_STATE_FAILED);
    EXPECT_TRUE(store->insert(job, event(1)));
    ids.insert(ids.begin(), job.job.job_id());
  }
  std::vector<std::string> seen;
  std::string token;
  do {
    const JobPage page = store->list({.tenant = {}, .page_size = 2, .token = token, .states = {}, .labels = {}});
    for (const v1::Job& job : page.jobs) {
      seen.push_back(job.job_id());
      EXPECT_FALSE(job.has_quality());
    }
    token = page.next_token;
  } while (!token.empty());
  EXPECT_EQ(seen, ids);
  EXPECT_EQ(store->list({.tenant = {}, .page_size = 10, .token = "", .states = {v1::JOB_STATE_FAILED}, .labels = {}}).jobs.size(), 1u);
}

TEST_P(JobStores, RemovedJobsAreGoneAndUpdatesToThemDoNothing) {
  const auto store = open();
  const StoredJob job = stored("r");
  EXPECT_TRUE(store->insert(job, event(1)));
  store->remove(job.job.job_id());
  store->update(job.job, {event(2)});
  EXPECT_FALSE(store->find(job.job.job_id()));
  EXPECT_FALSE(store->find_request("", "r"));
  EXPECT_TRUE(store->events(job.job.job_id(), 0).empty());
  EXPECT_EQ(store->count(), 0);
}

TEST_P(JobStores, ARequestIdMakesOneJobPerTenant) {
  const auto store = open();
  StoredJob mine = stored("r"), again = stored("r"), other = stored("r");
  other.job.set_tenant("other");
  EXPECT_TRUE(store->insert(mine, event(1)));
  EXPECT_FALSE(store->insert(again, event(1)));
  EXPECT_TRUE(store->insert(other, event(1)));
  EXPECT_EQ(store->count(), 2);
  EXPECT_EQ(store->find_request("other", "r")->job.job_id(), other.job.job_id());
}

TEST_P(JobStores, AJobBecomesFinalOnce) {
  const auto store = open();
  StoredJob job = stored();
  EXPECT_TRUE(store->insert(job, event(1)));
  job.job.set_state(v1::JOB_STATE_SUCCEEDED);
  store->update(job.job, {event(2)});
  job.job.set_state(v1::JOB_STATE_CANCELLED);
  store->update(job.job, {event(3)});
  EXPECT_EQ(store->find(job.job.job_id())->job.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(store->events(job.job.job_id(), 0).size(), 2u);
  EXPECT_TRUE(store->unfinished().empty());
}

TEST_P(JobStores, TenantsAndLabelsFilterTheList) {
  const auto store = open();
  for (int i = 0; i < 6; ++i) {
    StoredJob job = stored();
    job.job.set_tenant(i % 2 == 0 ? "even" : "odd");
    (*job.job.mutable_labels())["third"] = i % 3 == 0 ? "yes" : "no";
    EXPECT_TRUE(store->insert(job, event(1)));
  }
  JobQuery query;
  query.tenant = "even";
  EXPECT_EQ(store->list(query).jobs.size(), 3u);
  query.labels = {{"third", "yes"}};
  EXPECT_EQ(store->list(query).jobs.size(), 1u);
  query.tenant.reset();
  query.page_size = 1;
  const JobPage first = store->list(query);
  ASSERT_EQ(first.jobs.size(), 1u);
  query.token = first.next_token;
  const JobPage second = store->list(query);
  ASSERT_EQ(second.jobs.size(), 1u);
  EXPECT_NE(first.jobs[0].job_id(), second.jobs[0].job_id());
  EXPECT_TRUE(second.next_token.empty());
  query.labels = {{"fourth", "yes"}};
  query.token.clear();
  EXPECT_TRUE(store->list(query).jobs.empty());
}

TEST_P(JobStores, TellsWhatExpiredWhatIsUsedAndHowMuch) {
  const auto store = open();
  StoredJob job = stored();
  job.job.set_tenant("t");
  job.request.mutable_surface()->set_blob_id("surface");
  EXPECT_TRUE(store->insert(job, event(1)));
  EXPECT_TRUE(store->uses("surface"));
  job.job.set_state(v1::JOB_STATE_SUCCEEDED);
  job.job.mutable_expire_time()->set_seconds(1000);
  v1::Blob& blob = *job.job.add_artifacts()->mutable_blob();
  blob.set_blob_id("mesh");
  blob.set_size_bytes(77);
  store->update(job.job, {});
  EXPECT_TRUE(store->uses("mesh"));
  EXPECT_TRUE(store->expired(1000, 10).empty());
  EXPECT_EQ(store->expired(1001, 10), std::vector<std::string>{job.job.job_id()});
  EXPECT_TRUE(store->expired(1001, 0).empty());
  store->remove(job.job.job_id());
  EXPECT_FALSE(store->uses("mesh"));
  EXPECT_FALSE(store->uses("surface"));
}

TEST_P(JobStores, TakesWritesFromManyThreads) {
  const auto store = open();
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 25; ++i) EXPECT_TRUE(store->insert(stored("r" + std::to_string(25 * t + i)), event(1)));
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(store->count(), 200);
  for (int i = 0; i < 200; ++i) EXPECT_TRUE(store->find_request("", "r" + std::to_string(i)));
}

TEST_P(JobStores, AFilterThatFitsFewStopsNowAndThenAndFindsAllTheSame) {
  const std::unique_ptr<JobStore> store = GetParam() ? open_job_store(folder_.path(), Durability::Process) : make_memory_job_store();
  std::vector<std::string> marked;
  const int count = kMostLooked + kMostLooked / 2;
  for (int i = 0; i < count; ++i) {
    StoredJob job = stored();
    if (i == 0 || i == count - 1) {
      (*job.job.mutable_labels())["case"] = "a7";
      marked.insert(marked.begin(), job.job.job_id());
    }
    ASSERT_TRUE(store->insert(job, event(1)));
  }
  JobQuery query;
  query.labels = {{"case", "a7"}};
  std::vector<std::string> found;
  int pages = 0;
  do {
    const JobPage page = store->list(query);
    for (const v1::Job& job : page.jobs) found.push_back(job.job_id());
    query.token = page.next_token;
    ++pages;
  } while (!query.token.empty() && pages < 10);
  EXPECT_EQ(found, marked);
  EXPECT_EQ(pages, 2);
}

TEST_P(JobStores, APageFitsAMessage) {
  const auto store = open();
  constexpr int kJobs = 400;
  for (int i = 0; i < kJobs; ++i) {
    StoredJob job = stored();
    for (int k = 0; k < 32; ++k) (*job.job.mutable_labels())[std::to_string(k) + std::string(120, 'k')] = std::string(128, 'v');
    ASSERT_TRUE(store->insert(job, event(1)));
  }
  JobQuery query;
  query.page_size = 1000;
  std::size_t found = 0;
  do {
    const JobPage page = store->list(query);
    std::size_t bytes = 0;
    for (const v1::Job& job : page.jobs) bytes += job.ByteSizeLong();
    EXPECT_LT(bytes, std::size_t{3} << 20);
    ASSERT_FALSE(page.jobs.empty());
    found += page.jobs.size();
    query.token = page.next_token;
  } while (!query.token.empty());
  EXPECT_EQ(found, kJobs);
}

TEST_P(JobStores, WhatHasNotEndedDoesNotExpire) {
  const auto store = open();
  StoredJob job = stored();
  job.job.mutable_expire_time()->set_seconds(1);
  ASSERT_TRUE(store->insert(job, event(1)));
  EXPECT_TRUE(store->expired(100, 10).empty());
  job.job.set_state(v1::JOB_STATE_CANCELLED);
  store->update(job.job, {});
  EXPECT_EQ(store->expired(100, 10), std::vector<std::string>{job.job.job_id()});
}

INSTANTIATE_TEST_SUITE_P(MemoryAndSqlite, JobStores, testing::Bool(), [](const auto& which) { return which.param ? "Sqlite" : "Memory"; });

}  // namespace
}  // namespace strata::server
