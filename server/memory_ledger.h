// Who may use how much memory: jobs reserve what they are estimated to need before the expensive stages begin.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace strata::server {

// What a job with this estimate is given before it counts as out of hand: estimates are crude, and killing a good job is dear.
std::int64_t memory_limit_for(std::int64_t estimated_bytes);

// Throws MeshError(LimitExceeded, MemoryBudgetExceeded), with the figures, when a job that needs `bytes` could not even run alone. A budget of 0
// is none.
void refuse_what_never_fits(std::int64_t bytes, std::int64_t budget);

class MemoryLedger {
 public:
  explicit MemoryLedger(std::int64_t budget_bytes) : budget_(budget_bytes) {}

  [[nodiscard]] std::int64_t budget() const { return budget_; }
  [[nodiscard]] std::int64_t reserved() const;
  // False: not now. Throws MeshError(LimitExceeded, MemoryBudgetExceeded) when it can never be. One reservation a job.
  [[nodiscard]] bool try_reserve(const std::string& job_id, std::int64_t bytes);
  void release(const std::string& job_id);

 private:
  const std::int64_t budget_;
  mutable std::mutex mutex_;
  std::map<std::string, std::int64_t> reserved_;
  std::int64_t sum_ = 0;
};

}  // namespace strata::server
