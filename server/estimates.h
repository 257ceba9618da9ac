// Costs that are known already, from checks and from runs: a surface and a specification cost the same each time.
#pragma once

#include <cstddef>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "strata/v1/job.pb.h"

namespace strata::server {

// Safe to call from any thread. Forgets the ones that were asked for longest ago.
class Estimates {
 public:
  explicit Estimates(std::size_t most = 10'000) : most_(most) {}

  // What names a surface with these bytes and how to read them, under this specification.
  static std::string key(const std::string& sha256, const v1::Surface& surface, const v1::MeshSpec& spec);

  std::optional<v1::Estimate> find(const std::string& key);
  void remember(const std::string& key, const v1::Estimate& estimate);

 private:
  using Order = std::list<std::pair<std::string, v1::Estimate>>;  // latest first

  const std::size_t most_;
  std::mutex mutex_;
  Order order_;
  std::map<std::string, Order::iterator> known_;
};

}  // namespace strata::server
