#include <algorithm>
#include <iterator>
#include <map>
#include <mutex>
#include <utility>

#include "server/job_store.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

class MemoryJobStore final : public JobStore {
 public:
  bool insert(const StoredJob& stored, const v1::WatchJobResponse& first_event) override {
    const std::lock_guard lock(mutex_);
    const RequestKey request{stored.job.tenant(), stored.request.request_id()};
    if (!request.second.empty() && by_request_.contains(request)) return false;
    const std::int64_t order = ++last_order_;
    order_of_[stored.job.job_id()] = order;
    if (!request.second.empty()) by_request_[request] = order;
    rows_[order] = {stored, {first_event}};
    return true;
  }

  std::optional<StoredJob> find(const std::string& job_id) const override {
    const std::lock_guard lock(mutex_);
    const Row* row = row_of(job_id);
    return row == nullptr ? std::nullopt : std::optional(row->stored);
  }

  std::optional<StoredJob> find_request(const std::string& tenant, const std::string& request_id) const override {
    const std::lock_guard lock(mutex_);
    const auto found = by_request_.find({tenant, request_id});
    return found == by_request_.end() ? std::nullopt : std::optional(rows_.at(found->second).stored);
  }

  void update(const v1::Job& job, const std::vector<v1::WatchJobResponse>& new_events) override {
    const std::lock_guard lock(mutex_);
    Row* row = const_cast<Row*>(row_of(job.job_id()));
    if (row == nullptr || is_final(row->stored.job.state())) return;
    row->stored.job = job;
    row->events.insert(row->events.end(), new_events.begin(), new_events.end());
  }

  std::vector<v1::WatchJobResponse> events(const std::string& job_id, std::int64_t after_sequence) const override {
    const std::lock_guard lock(mutex_);
    std::vector<v1::WatchJobResponse> result;
    if (const Row* row = row_of(job_id))
      std::copy_if(row->events.begin(), row->events.end(), std::back_inserter(result),
                   [&](const v1::WatchJobResponse& event) { return event.sequence() > after_sequence; });
    return result;
  }

  JobPage list(const JobQuery& query) const override {
    const std::lock_guard lock(mutex_);
    JobPage page;
    auto row = query.token.empty() ? rows_.rbegin() : std::make_reverse_iterator(rows_.lower_bound(std::stoll(query.token)));
    std::size_t bytes = 0;
    for (int looked = 0; row != rows_.rend(); ++row) {
      const v1::Job& job = row->second.stored.job;
      if (query.tenant && job.tenant() != *query.tenant) continue;
      if (!query.states.empty() && std::find(query.states.begin(), query.states.end(), job.state()) == query.states.end()) continue;
      const bool fits = has_labels(job, query.labels);
      if (looked++ == kMostLooked || bytes > kPageBytes || (fits && static_cast<int>(page.jobs.size()) == query.page_size)) {
        page.next_token = std::to_string(row->first + 1);
        break;
      }
      if (!fits) continue;
      page.jobs.push_back(without_details(job));
      bytes += page.jobs.back().ByteSizeLong();
    }
    return page;
  }

  void remove(const std::string& job_id) override {
    const std::lock_guard lock(mutex_);
    const auto found = order_of_.find(job_id);
    if (found == order_of_.end()) return;
    const StoredJob& stored = rows_.at(found->second).stored;
    by_request_.erase({stored.job.tenant(), stored.request.request_id()});
    rows_.erase(found->second);
    order_of_.erase(found);
  }

  std::vector<StoredJob> unfinished() const override {
    const std::lock_guard lock(mutex_);
    std::vector<StoredJob> result;
    for (const auto& [order, row] : rows_)
      if (!is_final(row.stored.job.state())) result.push_back(row.stored);
    return result;
  }

  std::vector<std::string> expired(std::int64_t now, int at_most) const override {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> result;
    for (const auto& [order, row] : rows_) {
      const std::int64_t expiry = expiry_of(row.stored.job);
      if (is_final(row.stored.job.state()) && expiry != 0 && expiry < now && static_cast<int>(result.size()) < at_most)
        result.push_back(row.stored.job.job_id());
    }
    return result;
  }

  bool uses(const std::string& blob_id) const override {
    const std::lock_guard lock(mutex_);
    return std::any_of(rows_.begin(), rows_.end(), [&](const auto& row) {
      const StoredJob& stored = row.second.stored;
      const auto is_it = [&](const v1::Artifact& artifact) { return artifact.blob().blob_id() == blob_id; };
      return stored.request.surface().blob_id() == blob_id ||
             std::any_of(stored.job.artifacts().begin(), stored.job.artifacts().end(), is_it);
    });
  }

  std::int64_t count() const override {
    const std::lock_guard lock(mutex_);
    return static_cast<std::int64_t>(rows_.size());
  }

 private:
  using RequestKey = std::pair<std::string, std::string>;  // tenant, id
  struct Row {
    StoredJob stored;
    std::vector<v1::WatchJobResponse> events;
  };

  const Row* row_of(const std::string& job_id) const {
    const auto found = order_of_.find(job_id);
    return found == order_of_.end() ? nullptr : &rows_.at(found->second);
  }

  mutable std::mutex mutex_;
  std::int64_t last_order_ = 0;
  std::map<std::int64_t, Row> rows_;  // by order of creation
  std::map<std::string, std::int64_t> order_of_;
  std::map<RequestKey, std::int64_t> by_request_;
};

}  // namespace

v1::Job without_details(v1::Job job) {
  job.clear_spec();
  job.clear_patches();
  job.clear_quality();
  job.clear_stages();
  job.clear_adjustments();
  return job;
}

bool is_final(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

std::int64_t result_bytes(const v1::Job& job) {
  std::int64_t bytes = 0;
  for (const v1::Artifact& artifact : job.artifacts()) bytes += artifact.blob().size_bytes();
  return bytes;
}

std::int64_t expiry_of(const v1::Job& job) { return job.expire_time().seconds(); }

bool has_labels(const v1::Job& job, const std::vector<std::pair<std::string, std::string>>& labels) {
  return std::all_of(labels.begin(), labels.end(), [&](const auto& label) {
    const auto found = job.labels().find(label.first);
    return found != job.labels().end() && found->second == label.second;
  });
}

std::unique_ptr<JobStore> make_memory_job_store() { return std::make_unique<MemoryJobStore>(); }

}  // namespace strata::server
