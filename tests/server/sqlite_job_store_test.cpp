// What only the store on disk does: it remembers, grows with versions, is copied, and may be locked.
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include "server/job_store.h"
#include "tests/server/store_fixture.h"

namespace strata::server {
namespace {

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
    EXPECT_EQ(refusal_of([&] { static_cast<void>(store->insert(job, {})); }), "STORAGE_FAILED");
    other.run("ROLLBACK");
  }
  EXPECT_TRUE(store->insert(job, {}));
}

}  // namespace
}  // namespace strata::server
