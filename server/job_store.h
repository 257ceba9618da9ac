// Where jobs are remembered: the record, the request and the log of events that matter (all but progress and heartbeats).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/durability.h"
#include "strata/v1/job.pb.h"

namespace strata::server {

struct StoredJob {
  v1::Job job;
  v1::CreateJobRequest request;  // surface by blob_id always; the specification typed
  std::string fingerprint;       // of the request as it came: tells a repeated request id from a reused one
};

struct JobPage {
  std::vector<v1::Job> jobs;  // newest first, without the fields lists leave out
  std::string next_token;     // empty: last page
};

// A page ends before it is full when it has looked at so many jobs, so that a filter which fits few keeps nobody waiting, or when it holds so
// many bytes: a message of 4 MiB is what clients take.
inline constexpr int kMostLooked = 10'000;
inline constexpr std::size_t kPageBytes = std::size_t{2} << 20;

struct JobQuery {
  std::optional<std::string> tenant;  // only of this one
  int page_size = 100;
  std::string token;  // of the page before
  std::vector<int> states;  // only in one of these; empty: all
  std::vector<std::pair<std::string, std::string>> labels;  // only with all of these
};

// Safe to call from any thread. What a durable store returned from is durable. Whose a job is stands in Job.tenant.
class JobStore {
 public:
  virtual ~JobStore() = default;

  // False, and nothing happens, when the tenant has a job with this request id already.
  [[nodiscard]] virtual bool insert(const StoredJob& stored, const v1::WatchJobResponse& first_event) = 0;
  virtual std::optional<StoredJob> find(const std::string& job_id) const = 0;
  // The job once created with this request id.
  virtual std::optional<StoredJob> find_request(const std::string& tenant, const std::string& request_id) const = 0;
  // Replaces the record and adds events to the log, together. Nothing happens when the job was removed or is final already: it becomes so
  // once.
  virtual void update(const v1::Job& job, const std::vector<v1::WatchJobResponse>& new_events) = 0;
  virtual std::vector<v1::WatchJobResponse> events(const std::string& job_id, std::int64_t after_sequence) const = 0;
  virtual JobPage list(const JobQuery& query) const = 0;
  virtual void remove(const std::string& job_id) = 0;
  // Every job that has not ended, oldest first; for start-up.
  virtual std::vector<StoredJob> unfinished() const = 0;
  virtual std::int64_t count() const = 0;
  // Some jobs that have ended and whose Job.expire_time is before this, in seconds since 1970.
  virtual std::vector<std::string> expired(std::int64_t now, int at_most) const = 0;
  // Does a job need this blob, as surface or as result?
  virtual bool uses(const std::string& blob_id) const = 0;
};

std::unique_ptr<JobStore> make_memory_job_store();
// SQLite, write-ahead log, synced before each call returns: FOLDER/jobs.db. Writes that come together share a sync. A store of an older
// version is brought up to date. Throws std::runtime_error when it cannot be opened or was written by a newer version.
std::unique_ptr<JobStore> open_job_store(const std::string& folder, Durability durability = Durability::PowerLoss);
// A copy of FOLDER/jobs.db as it is at one moment, while a server may be using it. Throws std::runtime_error.
void back_up_job_store(const std::string& folder, const std::string& target);

bool is_final(v1::JobState state);
// What a job's results take.
std::int64_t result_bytes(const v1::Job& job);
// Seconds since 1970; 0: never.
std::int64_t expiry_of(const v1::Job& job);
bool has_labels(const v1::Job& job, const std::vector<std::pair<std::string, std::string>>& labels);

// The record as lists show it.
v1::Job without_details(v1::Job job);

}  // namespace strata::server
