#include "server/job_queue.h"

#include <algorithm>

namespace strata::server {

// Where it stands or would.
std::deque<JobQueue::Waiting>::const_iterator JobQueue::find(const Tenant& tenant, const Place& place) {
  return std::lower_bound(tenant.waiting.begin(), tenant.waiting.end(), place,
                          [](const Waiting& waiting, const Place& other) { return waiting.place < other; });
}

void JobQueue::push(const std::string& job_id, const std::string& tenant, int priority, double arrived) {
  Tenant& mine = tenants_[tenant];
  if (mine.waiting.empty()) mine.had = std::max(mine.had, least_had_);
  const Place place{arrived - kSecondsPerPriority * priority, arrivals_++};
  mine.waiting.insert(find(mine, place), {place, job_id});
  places_[job_id] = {tenant, place};
}

bool JobQueue::remove(const std::string& job_id) {
  const auto found = places_.find(job_id);
  if (found == places_.end()) return false;
  auto& [tenant, place] = found->second;
  Tenant& mine = tenants_[tenant];
  mine.waiting.erase(find(mine, place));
  places_.erase(found);
  return true;
}

void JobQueue::charge(const std::string& tenant, double core_seconds, double weight) {
  tenants_[tenant].had += core_seconds / std::max(weight, 1e-3);  // a weight of nothing is still served
}

std::size_t JobQueue::size_of(const std::string& tenant) const {
  const auto found = tenants_.find(tenant);
  return found == tenants_.end() ? 0 : found->second.waiting.size();
}

int JobQueue::ahead_of(const std::string& job_id) const {
  const auto found = places_.find(job_id);
  if (found == places_.end()) return 0;
  const Tenant& mine = tenants_.at(found->second.first);
  return static_cast<int>(find(mine, found->second.second) - mine.waiting.begin());
}

}  // namespace strata::server
