// A store full of finished jobs.
#include <sqlite3.h>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "server/blob_store.h"
#include "server/ids.h"
#include "server/job_store.h"
#include "tests/server/load_fixture.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

// One finished job in the store, copied there many times with its blob.
void fill_store(const std::string& folder, int count) {
  v1::Job job;
  {
    const auto jobs = open_job_store(folder);
    StoredJob stored;
    stored.job.set_job_id(random_id());
    stored.job.set_state(v1::JOB_STATE_SUCCEEDED);
    stored.job.set_hexes(1000);
    stored.request.mutable_surface()->set_blob_id(random_id());
    ASSERT_TRUE(jobs->insert(stored, {}));
    static_cast<void>(open_file_blob_store(folder));
  }
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((folder + "/jobs.db").c_str(), &database), SQLITE_OK);
  const std::string more = std::to_string(count);
  const std::string sql =
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " + more +
      ") INSERT INTO job(id, tenant, request_id, state, final, expiry, bytes, fingerprint, request, job) "
      "SELECT printf('%026d', i), tenant, NULL, state, final, 4000000000 + i, 1000, fingerprint, request, job FROM job, n;"
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " +
      more +
      ") INSERT INTO event(job_id, sequence, event) SELECT printf('%026d', i), 1, event FROM event, n;"
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " +
      more + ") INSERT INTO blob_use(blob_id, job_id) SELECT printf('%026d', i), printf('%026d', i) FROM n;";
  ASSERT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
  sqlite3_close(database);
  for (int i = 1; i <= count; ++i) {
    char name[128];
    std::snprintf(name, sizeof name, "/blobs/%026d-%064d", i, i);
    std::ofstream(folder + name) << "x";
  }
}

TEST_F(Load, AStoreFullOfFinishedJobsIsOpenedSoon) {
  const int count = is_long() ? 100'000 : 10'000;
  const std::string folder = (fs::temp_directory_path() / ("strata-load-" + random_id())).string();
  fill_store(folder + "/data", count);
  {
    Daemon daemon({"--slots", "1"}, folder);
    const auto stub = v1::JobService::NewStub(daemon.connect());
    const auto asked = Clock::now();
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    EXPECT_TRUE(stub->ListJobs(&context, {}, &response).ok());
    std::printf("%d finished jobs: ready after %.2f s, the first page after %.1f ms, server %lld MiB\n", count,
                daemon.time_to_ready().count(), 1e3 * seconds_since(asked), static_cast<long long>(daemon.resident_bytes() / kMiB));
    EXPECT_EQ(response.jobs_size(), 100);
    EXPECT_LT(daemon.time_to_ready().count(), 5 * slowness());
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace strata::server
