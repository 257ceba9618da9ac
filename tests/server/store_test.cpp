// One contract for every store.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

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
  EXPECT_EQ(store->usage("t").bytes, 77);
  EXPECT_EQ(store->usage("t").jobs, 1);
  EXPECT_EQ(store->usage("u").jobs, 0);
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

INSTANTIATE_TEST_SUITE_P(MemoryAndSqlite, JobStores, testing::Bool(), [](const auto& which) { return which.param ? "Sqlite" : "Memory"; });

TEST(SqliteJobStore, RemembersAcrossRestart) {
  const Folder folder;
  StoredJob job;
  job.job.set_job_id(random_id());
  EXPECT_TRUE(open_job_store(folder.path())->insert(job, {}));
  EXPECT_TRUE(open_job_store(folder.path())->find(job.job.job_id()));
}

class Sql {
 public:
  explicit Sql(const std::string& path) { EXPECT_EQ(sqlite3_open(path.c_str(), &database_), SQLITE_OK); }
  ~Sql() { sqlite3_close(database_); }
  void run(const std::string& sql) { EXPECT_EQ(sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sql; }

 private:
  sqlite3* database_ = nullptr;
};

std::string sql_blob(const std::string& bytes) {
  std::string text = "x'";
  char digits[3];
  for (const unsigned char byte : bytes) {
    std::snprintf(digits, sizeof digits, "%02x", byte);
    text += digits;
  }
  return text + "'";
}

TEST(SqliteJobStore, BringsAStoreOfTheFirstVersionUpToDate) {
  const Folder folder;
  v1::Job done, waiting;
  done.set_job_id(random_id());
  done.set_state(v1::JOB_STATE_SUCCEEDED);
  done.add_artifacts()->mutable_blob()->set_blob_id("mesh");
  waiting.set_job_id(random_id());
  waiting.set_state(v1::JOB_STATE_QUEUED);
  v1::CreateJobRequest request;
  request.mutable_surface()->set_blob_id("surface");
  {
    Sql sql(folder.path() + "/jobs.db");
    sql.run(
        "CREATE TABLE job(place INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, request_id TEXT UNIQUE, state INTEGER NOT NULL,"
        "fingerprint BLOB NOT NULL, request BLOB NOT NULL, job BLOB NOT NULL);"
        "CREATE TABLE event(job_id TEXT NOT NULL, sequence INTEGER NOT NULL, event BLOB NOT NULL, PRIMARY KEY(job_id, sequence)) WITHOUT "
        "ROWID;"
        "PRAGMA user_version = 1;");
    for (const v1::Job& job : {done, waiting})
      sql.run("INSERT INTO job(id, request_id, state, fingerprint, request, job) VALUES('" + job.job_id() + "', 'r" + job.job_id() + "', " +
              std::to_string(job.state()) + ", x'00', " + sql_blob(request.SerializeAsString()) + ", " + sql_blob(job.SerializeAsString()) +
              ")");
  }
  const auto store = open_job_store(folder.path());
  ASSERT_EQ(store->unfinished().size(), 1u);
  EXPECT_EQ(store->unfinished()[0].job.job_id(), waiting.job_id());
  EXPECT_EQ(store->find_request("", "r" + done.job_id())->job.job_id(), done.job_id());
  EXPECT_TRUE(store->uses("mesh"));
  EXPECT_TRUE(store->uses("surface"));
  EXPECT_EQ(store->list({}).jobs.size(), 2u);
}

TEST(SqliteJobStore, RefusesAStoreOfANewerVersion) {
  const Folder folder;
  Sql(folder.path() + "/jobs.db").run("PRAGMA user_version = 999");
  EXPECT_THROW(open_job_store(folder.path()), std::runtime_error);
}

TEST(SqliteJobStore, IsBackedUpWhileInUse) {
  const Folder folder, copy;
  const auto store = open_job_store(folder.path());
  StoredJob job;
  job.job.set_job_id(random_id());
  EXPECT_TRUE(store->insert(job, {}));
  back_up_job_store(folder.path(), copy.path() + "/jobs.db");
  EXPECT_TRUE(open_job_store(copy.path())->find(job.job.job_id()));
  EXPECT_THROW(back_up_job_store(folder.path(), "/no/such/folder/jobs.db"), std::runtime_error);
}

TEST(SqliteJobStore, SaysThatItIsLockedAndRecovers) {
  const Folder folder;
  const auto store = open_job_store(folder.path());
  StoredJob job;
  job.job.set_job_id(random_id());
  {
    Sql other(folder.path() + "/jobs.db");
    other.run("BEGIN EXCLUSIVE");
    EXPECT_EQ(reason_of([&] { static_cast<void>(store->insert(job, {})); }), "STORAGE_FAILED");
    other.run("ROLLBACK");
  }
  EXPECT_TRUE(store->insert(job, {}));
}

TEST(BlobStore, KeepsTenantsApartAcrossRestart) {
  const Folder folder;
  std::string mine, upload;
  {
    const auto store = open_file_blob_store(folder.path());
    const auto writer = store->create(owner_key("acme"));
    writer->write("same bytes");
    mine = writer->publish().id;
    upload = store->start_upload(4, "", owner_key("acme")).id;
  }
  const auto store = open_file_blob_store(folder.path());
  ASSERT_TRUE(store->find(mine));
  EXPECT_TRUE(sees_blob({"", "acme", Role::Viewer, ""}, *store->find(mine)));
  EXPECT_FALSE(sees_blob({"", "other", Role::Submitter, ""}, *store->find(mine)));
  EXPECT_TRUE(store->find_digest(digest("same bytes"), owner_key("acme")));
  EXPECT_FALSE(store->find_digest(digest("same bytes"), owner_key("other")));
  EXPECT_FALSE(store->find_digest(digest("same bytes"), ""));
  EXPECT_EQ(store->find_upload(upload)->owner, owner_key("acme"));
}

// The sweep and a writer want the same two locks.
TEST(BlobStore, SweepsWhileUploadsEnd) {
  const Folder folder;
  const auto store = open_file_blob_store(folder.path());
  std::atomic<bool> over = false;
  std::thread sweeper([&] {
    while (!over) store->drop_uploads_idle_since(std::chrono::system_clock::now() - std::chrono::hours(1));
  });
  for (int i = 0; i < 300; ++i) EXPECT_TRUE(store->write_upload(store->start_upload(4, "", "").id, 0, "four").blob);
  over = true;
  sweeper.join();
}

TEST(BlobStore, TellsWhatIsIdleAndDropsUploadsNobodyContinues) {
  using namespace std::chrono_literals;
  const Folder folder;
  const auto store = open_file_blob_store(folder.path());
  const auto writer = store->create("");
  writer->write("x");
  const std::string id = writer->publish().id;
  const std::string upload = store->start_upload(4, "", "").id;
  const auto now = std::chrono::system_clock::now();
  EXPECT_TRUE(store->idle_since(now - 1h).empty());
  EXPECT_EQ(store->idle_since(now + 1h), std::vector<std::string>{id});
  store->drop_uploads_idle_since(now - 1h);
  EXPECT_TRUE(store->find_upload(upload));
  store->drop_uploads_idle_since(now + 1h);
  EXPECT_FALSE(store->find_upload(upload));
  EXPECT_TRUE(fs::is_empty(folder.path() + "/uploads"));
}

}  // namespace
}  // namespace strata::server
