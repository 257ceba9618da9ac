#include "server/job_queue.h"

#include <algorithm>
#include <iterator>

namespace strata::server {

void JobQueue::push(const std::string& job_id, const std::string& tenant, int priority, double arrived) {
  Tenant& mine = tenants_[tenant];
  if (mine.waiting.empty()) mine.had = std::max(mine.had, least_had_);
  const Place place{arrived - kSecondsPerPriority * priority, arrivals_++};
  mine.waiting.emplace(place, job_id);
  places_[job_id] = {tenant, place};
}

bool JobQueue::remove(const std::string& job_id) {
  const auto found = places_.find(job_id);
  if (found == places_.end()) return false;
  tenants_[found->second.first].waiting.erase(found->second.second);
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
  const auto& waiting = tenants_.at(found->second.first).waiting;
  return static_cast<int>(std::distance(waiting.begin(), waiting.find(found->second.second)));
}

}  // namespace strata::server
