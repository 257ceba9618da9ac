#include "server/job_schema.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include "server/job_store.h"

namespace strata::server {
namespace {

constexpr int kSchemaVersion = 2;

// How version 1 was; later versions are steps from there, so that a new store and an old one go the same way.
constexpr const char* kVersion1 = R"(
  CREATE TABLE job(
    place INTEGER PRIMARY KEY AUTOINCREMENT,  -- order of creation
    id TEXT NOT NULL UNIQUE,
    request_id TEXT UNIQUE,
    state INTEGER NOT NULL,
    fingerprint BLOB NOT NULL,
    request BLOB NOT NULL,
    job BLOB NOT NULL);
  CREATE TABLE event(
    job_id TEXT NOT NULL,
    sequence INTEGER NOT NULL,
    event BLOB NOT NULL,
    PRIMARY KEY(job_id, sequence)) WITHOUT ROWID;
  PRAGMA user_version = 1;)";

// Tenants, times to live, and who uses which blob, so that start-up need not read every job.
constexpr const char* kVersion2 = R"(
  CREATE TABLE job2(
    place INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    tenant TEXT NOT NULL DEFAULT '',
    request_id TEXT,
    state INTEGER NOT NULL,
    final INTEGER NOT NULL DEFAULT 0,
    expiry INTEGER NOT NULL DEFAULT 0,        -- seconds since 1970; 0: never
    bytes INTEGER NOT NULL DEFAULT 0,         -- of results
    fingerprint BLOB NOT NULL,
    request BLOB NOT NULL,
    job BLOB NOT NULL,
    UNIQUE(tenant, request_id));
  INSERT INTO job2(place, id, request_id, state, fingerprint, request, job)
    SELECT place, id, request_id, state, fingerprint, request, job FROM job;
  DROP TABLE job;
  ALTER TABLE job2 RENAME TO job;
  CREATE INDEX job_unfinished ON job(place) WHERE final = 0;
  CREATE INDEX job_expiry ON job(expiry) WHERE expiry > 0;
  CREATE INDEX job_tenant ON job(tenant, place);
  CREATE TABLE blob_use(
    blob_id TEXT NOT NULL,
    job_id TEXT NOT NULL,
    PRIMARY KEY(blob_id, job_id)) WITHOUT ROWID;
  CREATE INDEX blob_use_job ON blob_use(job_id);
  PRAGMA user_version = 2;)";

// What version 2 keeps in columns of its own.
void fill_version_2(const Database& database) {
  std::vector<std::pair<v1::Job, std::string>> jobs;
  Statement rows(database.get(), "SELECT job, request FROM job");
  while (rows.step())
    jobs.emplace_back(decoded<v1::Job>(rows.bytes_at(0)), decoded<v1::CreateJobRequest>(rows.bytes_at(1)).surface().blob_id());
  for (const auto& [job, surface] : jobs) {
    Statement(database.get(), "UPDATE job SET final = ?, bytes = ? WHERE id = ?")
        .number(is_final(job.state()) ? 1 : 0)
        .number(result_bytes(job))
        .text(job.job_id())
        .step();
    std::vector<std::string> blobs{surface};
    for (const v1::Artifact& artifact : job.artifacts()) blobs.push_back(artifact.blob().blob_id());
    for (const std::string& blob : blobs)
      Statement(database.get(), "INSERT OR IGNORE INTO blob_use(blob_id, job_id) VALUES(?, ?)").text(blob).text(job.job_id()).step();
  }
}

std::int64_t version_of(const Database& database) {
  Statement row(database.get(), "PRAGMA user_version");
  row.step();
  return row.number_at(0);
}

}  // namespace

void migrate(const Database& database, const std::string& path) {
  if (version_of(database) > kSchemaVersion) throw std::runtime_error(path + " was written by a newer stratad");
  database.in_transaction([&] {
    if (version_of(database) == 0) database.run(kVersion1);
    if (version_of(database) == 1) {
      database.run(kVersion2);
      fill_version_2(database);
    }
  });
}

}  // namespace strata::server
