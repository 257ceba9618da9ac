// The order in which waiting jobs run: fair between tenants, by priority within one. Knows no threads: its owner locks.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace strata::server {

class JobQueue {
 public:
  // Jobs of a tenant run by priority, then by age; waiting kSecondsPerPriority counts as much as one step of priority. `arrived` in seconds
  // of any steady clock.
  static constexpr double kSecondsPerPriority = 300;
  void push(const std::string& job_id, const std::string& tenant, int priority, double arrived);
  // False when it does not wait.
  bool remove(const std::string& job_id);

  // The next job: of the tenant that has had the least of the cores for its weight. `may_run` says whether a tenant may have one more.
  template <class MayRun>
  std::optional<std::string> pop(const MayRun& may_run);

  // Core seconds that a tenant had (or, negative, gets back). A tenant that comes late does not get what it did not use before.
  void charge(const std::string& tenant, double core_seconds, double weight);

  [[nodiscard]] std::size_t size() const { return places_.size(); }
  [[nodiscard]] std::size_t size_of(const std::string& tenant) const;
  [[nodiscard]] bool holds(const std::string& job_id) const { return places_.contains(job_id); }
  // Jobs of the same tenant that go before this one.
  [[nodiscard]] int ahead_of(const std::string& job_id) const;

 private:
  using Place = std::pair<double, std::int64_t>;  // virtual time of arrival, then order of arrival
  struct Waiting {
    Place place;
    std::string job_id;
  };
  struct Tenant {
    std::deque<Waiting> waiting;  // by place: most come last and leave first, and all want to know how many are ahead
    double had = 0;  // core seconds over weight
  };

  static std::deque<Waiting>::const_iterator find(const Tenant& tenant, const Place& place);

  std::map<std::string, Tenant> tenants_;
  std::map<std::string, std::pair<std::string, Place>> places_;  // job -> tenant, place
  std::int64_t arrivals_ = 0;
  double least_had_ = 0;  // of the tenant served last
};

template <class MayRun>
std::optional<std::string> JobQueue::pop(const MayRun& may_run) {
  Tenant* next = nullptr;
  for (auto& [name, tenant] : tenants_)
    if (!tenant.waiting.empty() && (next == nullptr || tenant.had < next->had) && may_run(name)) next = &tenant;
  if (next == nullptr) return {};
  least_had_ = next->had;
  std::string job_id = next->waiting.front().job_id;
  remove(job_id);
  return job_id;
}

}  // namespace strata::server
