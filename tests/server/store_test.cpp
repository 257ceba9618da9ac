// One contract for every store.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "proto/wire/crc32c.h"
#include "proto/wire/sha256.h"
#include "server/blob_store.h"
#include "server/ids.h"
#include "server/job_store.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

class Folder {
 public:
  Folder() : path_((fs::temp_directory_path() / ("strata-store-" + random_id())).string()) { fs::create_directories(path_); }
  ~Folder() { fs::remove_all(path_); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string digest(const std::string& bytes) {
  wire::Sha256 sha;
  sha.add(bytes);
  return sha.finish();
}

template <class Body>
std::string reason_of(const Body& body) {
  try {
    body();
  } catch (const Refusal& refusal) {
    return refusal.reason;
  }
  return "accepted";
}

std::string text_of(const BlobStore& store, const std::string& id) {
  const std::vector<char> bytes = read_all(store, *store.find(id));
  return {bytes.begin(), bytes.end()};
}

TEST(Crc32c, AgreesWithTheRfc) {
  EXPECT_EQ(wire::crc32c("123456789"), 0xE3069283u);
  EXPECT_EQ(wire::crc32c(std::string(32, '\0')), 0x8A9136AAu);
  EXPECT_EQ(wire::crc32c("56789", wire::crc32c("1234")), 0xE3069283u);
}

TEST(Ids, AreRandomAndNothingElsePassesForOne) {
  EXPECT_NE(random_id(), random_id());
  EXPECT_TRUE(is_id(random_id()));
  EXPECT_FALSE(is_id(""));
  EXPECT_FALSE(is_id("../../../../../etc/passwd0"));
  EXPECT_FALSE(is_id("ABCDEFGHJKMNPQRSTVWXYZ0123"));
}

TEST(BlobStore, KeepsWhatWasPublishedAcrossRestartAndNothingElse) {
  const Folder folder;
  const std::string text(3'000'000, 'x');
  BlobInfo blob;
  {
    const auto store = open_file_blob_store(folder.path());
    const auto writer = store->create("");
    writer->write("ab");
    writer->write(text);
    writer->write("yz");
    blob = writer->publish();
    store->create("")->write("dropped");
  }
  const auto store = open_file_blob_store(folder.path());
  EXPECT_EQ(blob.size, 3'000'004);
  EXPECT_EQ(blob.sha256, digest("ab" + text + "yz"));
  EXPECT_EQ(text_of(*store, blob.id), "ab" + text + "yz");
  EXPECT_EQ(store->find_digest(blob.sha256, "")->id, blob.id);
  EXPECT_TRUE(fs::is_empty(folder.path() + "/temporary"));
  store->remove(blob.id);
  EXPECT_FALSE(store->find(blob.id));
  EXPECT_FALSE(store->find_digest(blob.sha256, ""));
  EXPECT_EQ(reason_of([&] { store->open(blob.id); }), "BLOB_NOT_FOUND");
}

TEST(BlobStore, UploadResumesAcrossRestartAtTheCommittedOffset) {
  const Folder folder;
  std::string id;
  {
    const auto store = open_file_blob_store(folder.path());
    id = store->start_upload(10, digest("0123456789"), "").id;
    store->write_upload(id, 0, "0123");
    EXPECT_EQ(store->find_upload(id)->committed, 0);
    EXPECT_EQ(store->commit_upload(id).committed, 4);
  }
  const auto store = open_file_blob_store(folder.path());
  ASSERT_TRUE(store->find_upload(id));
  EXPECT_EQ(store->find_upload(id)->committed, 4);
  const UploadInfo done = store->write_upload(id, 4, "456789");
  ASSERT_TRUE(done.blob);
  EXPECT_EQ(text_of(*store, done.blob->id), "0123456789");
}

TEST(BlobStore, UploadRefusesGapsOverlapsTooMuchAndAWrongDigest) {
  const Folder folder;
  const auto store = open_file_blob_store(folder.path());
  const std::string id = store->start_upload(4, digest("good"), "").id;
  EXPECT_EQ(reason_of([&] { store->write_upload(id, 1, "x"); }), "OFFSET_MISMATCH");
  EXPECT_EQ(reason_of([&] { store->write_upload(id, 0, "toolong"); }), "UPLOAD_TOO_LONG");
  EXPECT_EQ(reason_of([&] { store->write_upload(random_id(), 0, "x"); }), "UPLOAD_NOT_FOUND");
  EXPECT_EQ(reason_of([&] { store->write_upload(id, 0, "evil"); }), "DIGEST_MISMATCH");
  EXPECT_EQ(store->find_upload(id)->committed, 0);
  EXPECT_TRUE(store->write_upload(id, 0, "good").blob);
}

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

INSTANTIATE_TEST_SUITE_P(MemoryAndSqlite, JobStores, testing::Bool(), [](const auto& which) { return which.param ? "Sqlite" : "Memory"; });

TEST(SqliteJobStore, RemembersAcrossRestart) {
  const Folder folder;
  StoredJob job;
  job.job.set_job_id(random_id());
  EXPECT_TRUE(open_job_store(folder.path())->insert(job, {}));
  EXPECT_TRUE(open_job_store(folder.path())->find(job.job.job_id()));
}

}  // namespace
}  // namespace strata::server
