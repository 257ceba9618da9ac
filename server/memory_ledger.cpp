#include "server/memory_ledger.h"

#include <utility>

#include "core/base/diagnostic.h"

namespace strata::server {
namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;
constexpr std::int64_t kBaseOfWorker = 512 * kMiB;  // programs, stacks, allocator arenas
constexpr std::int64_t kOvershoot = 3;            // limit over estimate

}  // namespace

std::int64_t memory_limit_for(std::int64_t estimated_bytes) { return kOvershoot * estimated_bytes + kBaseOfWorker; }

void refuse_what_never_fits(std::int64_t bytes, std::int64_t budget) {
  if (budget == 0 || bytes <= budget) return;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::MemoryBudgetExceeded;
  diagnostic.values = {{"needed_bytes", static_cast<double>(bytes)}, {"budget_bytes", static_cast<double>(budget)}};
  diagnostic.message = "the mesh would need about " + std::to_string(bytes / kMiB) + " MiB, the server has " +
                       std::to_string(budget / kMiB) + " MiB for jobs: ask for larger cells";
  throw MeshError(Failure::LimitExceeded, std::move(diagnostic));
}

std::int64_t MemoryLedger::reserved() const {
  const std::lock_guard lock(mutex_);
  return sum_;
}

bool MemoryLedger::try_reserve(const std::string& job_id, std::int64_t bytes) {
  refuse_what_never_fits(bytes, budget_);
  const std::lock_guard lock(mutex_);
  std::int64_t& mine = reserved_[job_id];
  if (sum_ - mine + bytes > budget_) return false;
  sum_ += bytes - mine;
  mine = bytes;
  return true;
}

void MemoryLedger::release(const std::string& job_id) {
  const std::lock_guard lock(mutex_);
  const auto found = reserved_.find(job_id);
  if (found == reserved_.end()) return;
  sum_ -= found->second;
  reserved_.erase(found);
}

}  // namespace strata::server
