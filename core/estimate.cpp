#include "core/estimate.h"

#include <algorithm>

#include "core/dual/dual.h"

namespace strata {
namespace {

// Figures of the estimate, measured on the benchmark cases (docs/performance.md).
constexpr double kMeshedShareOfDual = 0.42;      // dual hexes that end inside the volume
constexpr double kBytesPerHex = 1200;            // peak of the whole process
constexpr double kCpuSecondsPerHex = 40e-6;

}  // namespace

Estimate estimate_of(std::int64_t triangles, const Octree& octree, const MeshSpec& spec) {
  Estimate estimate;
  estimate.triangles = triangles;
  estimate.octree_cells = static_cast<std::int64_t>(octree.block_count()) * 8;
  const auto dual_hexes = static_cast<double>(count_dual_hexes(octree));
  double layer_count = 0;
  for (const LayerSpec& l : spec.layers) layer_count = std::max(layer_count, static_cast<double>(l.count.value_or(5)));
  const double cut_cells = 4.0 * static_cast<double>(std::count(octree.cut.begin(), octree.cut.end(), 1));
  const double hexes = kMeshedShareOfDual * dual_hexes + layer_count * cut_cells;
  estimate.hexes = static_cast<std::int64_t>(hexes);
  estimate.memory_bytes = static_cast<std::int64_t>(kBytesPerHex * std::max(hexes, dual_hexes));
  estimate.cpu_seconds = kCpuSecondsPerHex * hexes;
  return estimate;
}

}  // namespace strata
