#include <algorithm>
#include <map>
#include <mutex>

#include "server/job_store.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

class MemoryJobStore final : public JobStore {
 public:
  void insert(const StoredJob& stored, const v1::WatchJobResponse& first_event) override {
    const std::lock_guard lock(mutex_);
    const std::int64_t order = ++last_order_;
    order_of_[stored.job.job_id()] = order;
    if (!stored.request.request_id().empty()) by_request_[stored.request.request_id()] = order;
    rows_[order] = {stored, {first_event}};
  }

  std::optional<StoredJob> find(const std::string& job_id) const override {
    const std::lock_guard lock(mutex_);
    const Row* row = row_of(job_id);
    return row == nullptr ? std::nullopt : std::optional(row->stored);
  }

  std::optional<StoredJob> find_request(const std::string& request_id) const override {
    const std::lock_guard lock(mutex_);
    const auto found = by_request_.find(request_id);
    return found == by_request_.end() ? std::nullopt : std::optional(rows_.at(found->second).stored);
  }

  void update(const v1::Job& job, const std::vector<v1::WatchJobResponse>& new_events) override {
    const std::lock_guard lock(mutex_);
    Row* row = const_cast<Row*>(row_of(job.job_id()));
    if (row == nullptr) return;
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

  JobPage list(int page_size, const std::string& token, const std::vector<int>& states) const override {
    const std::lock_guard lock(mutex_);
    JobPage page;
    auto row = token.empty() ? rows_.rbegin() : std::make_reverse_iterator(rows_.lower_bound(std::stoll(token)));
    for (; row != rows_.rend(); ++row) {
      const v1::Job& job = row->second.stored.job;
      if (!states.empty() && std::find(states.begin(), states.end(), job.state()) == states.end()) continue;
      if (static_cast<int>(page.jobs.size()) == page_size) {
        page.next_token = std::to_string(row->first + 1);
        break;
      }
      page.jobs.push_back(without_details(job));
    }
    return page;
  }

  void remove(const std::string& job_id) override {
    const std::lock_guard lock(mutex_);
    const auto found = order_of_.find(job_id);
    if (found == order_of_.end()) return;
    by_request_.erase(rows_.at(found->second).stored.request.request_id());
    rows_.erase(found->second);
    order_of_.erase(found);
  }

  std::vector<StoredJob> all() const override {
    const std::lock_guard lock(mutex_);
    std::vector<StoredJob> result;
    for (const auto& [order, row] : rows_) result.push_back(row.stored);
    return result;
  }

  std::int64_t count() const override {
    const std::lock_guard lock(mutex_);
    return static_cast<std::int64_t>(rows_.size());
  }

 private:
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
  std::map<std::string, std::int64_t> order_of_, by_request_;
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

std::unique_ptr<JobStore> make_memory_job_store() { return std::make_unique<MemoryJobStore>(); }

}  // namespace strata::server
