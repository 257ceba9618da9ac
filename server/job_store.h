// Where jobs are remembered: the record, the request and the log of events that matter (all but progress and heartbeats).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

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

// Safe to call from any thread. What a durable store returned from is durable.
class JobStore {
 public:
  virtual ~JobStore() = default;

  virtual void insert(const StoredJob& stored, const v1::WatchJobResponse& first_event) = 0;
  virtual std::optional<StoredJob> find(const std::string& job_id) const = 0;
  // The job once created with this request id.
  virtual std::optional<StoredJob> find_request(const std::string& request_id) const = 0;
  // Replaces the record and adds events to the log, together. Nothing happens when the job was removed.
  virtual void update(const v1::Job& job, const std::vector<v1::WatchJobResponse>& new_events) = 0;
  virtual std::vector<v1::WatchJobResponse> events(const std::string& job_id, std::int64_t after_sequence) const = 0;
  virtual JobPage list(int page_size, const std::string& token, const std::vector<int>& states) const = 0;
  virtual void remove(const std::string& job_id) = 0;
  // Every job, oldest first; for start-up.
  virtual std::vector<StoredJob> all() const = 0;
  virtual std::int64_t count() const = 0;
};

std::unique_ptr<JobStore> make_memory_job_store();
// SQLite, write-ahead log, synced before each call returns: FOLDER/jobs.db. Throws std::runtime_error when it cannot be opened or was
// written by a newer version.
std::unique_ptr<JobStore> open_job_store(const std::string& folder);

// The record as lists show it.
v1::Job without_details(v1::Job job);

}  // namespace strata::server
