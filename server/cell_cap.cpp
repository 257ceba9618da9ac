#include "server/cell_cap.h"

#include <algorithm>

#include "core/mesher.h"

namespace strata::server {
namespace {

constexpr std::int64_t kLeastBytesPerCell = 512;  // no mesh takes less

double value_of(const Diagnostic& diagnostic, const char* name) {
  for (const auto& [key, value] : diagnostic.values)
    if (key == name) return value;
  return 0;
}

}  // namespace

void CellCap::put_on(MeshSpec& spec, std::int64_t memory_budget_bytes) {
  const std::int64_t most = memory_budget_bytes / kLeastBytesPerCell;
  if (most == 0 || spec.sizing.max_cells.value_or(most + 1) <= most) return;
  spec.sizing.max_cells = most;
  budget_ = memory_budget_bytes;
  on_ = true;
}

bool CellCap::hear(const Diagnostic& adjustment) {
  if (!on_ || value_of(adjustment, "max_cells") == 0) return false;
  larger_ = std::max(larger_, value_of(adjustment, "factor"));
  return true;
}

Estimate CellCap::of_what_was_asked(Estimate grown) const {
  if (larger_ <= 1) return grown;
  const double times = larger_ * larger_;  // as for a surface, which is the least
  for (std::int64_t* figure : {&grown.octree_cells, &grown.hexes, &grown.memory_bytes})
    *figure = static_cast<std::int64_t>(times * static_cast<double>(*figure));
  grown.cpu_seconds *= times;
  grown.memory_bytes = std::max(grown.memory_bytes, budget_ + 1);
  return grown;
}

}  // namespace strata::server
