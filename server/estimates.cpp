#include "server/estimates.h"

#include "proto/wire/sha256.h"
#include "server/canonical.h"

namespace strata::server {

std::string Estimates::key(const std::string& sha256, const v1::Surface& surface, const v1::MeshSpec& spec) {
  v1::Surface reading = surface;
  reading.clear_source();
  wire::Sha256 sha;
  for (const std::string& part : {sha256, canonical_bytes(reading), canonical_bytes(spec)}) {
    sha.add(std::to_string(part.size()) + ":");
    sha.add(part);
  }
  return sha.finish();
}

std::optional<v1::Estimate> Estimates::find(const std::string& key) {
  const std::lock_guard lock(mutex_);
  const auto found = known_.find(key);
  if (found == known_.end()) return {};
  order_.splice(order_.begin(), order_, found->second);
  return found->second->second;
}

void Estimates::remember(const std::string& key, const v1::Estimate& estimate) {
  const std::lock_guard lock(mutex_);
  if (const auto found = known_.find(key); found != known_.end()) {
    found->second->second = estimate;
    order_.splice(order_.begin(), order_, found->second);
    return;
  }
  order_.emplace_front(key, estimate);
  known_[key] = order_.begin();
  if (known_.size() <= most_) return;
  known_.erase(order_.back().first);
  order_.pop_back();
}

}  // namespace strata::server
