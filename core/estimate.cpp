#include "core/estimate.h"

#include <algorithm>
#include <string>

#include "core/base/parallel.h"
#include "core/dual/dual.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

// Figures of the estimate, measured on the benchmark cases (docs/performance.md).
constexpr double kMeshedShareOfDual = 0.42;      // dual hexes that end inside the volume
constexpr double kBytesPerHex = 1200;            // peak of the whole process
constexpr double kCpuSecondsPerHex = 40e-6;

constexpr int kDefaultLayers = 5;  // where an entry leaves the count open

// Layers wished on each patch.
IdMap<PatchId, std::int64_t> layers_of_patches(const MeshSpec& spec, const Surface& surface) {
  IdMap<PatchId, std::int64_t> layers(surface.patch_names.size(), 0);
  for (PatchId p : layers.ids())
    for (const LayerSpec& entry : spec.layers) {
      const auto names_it = [&](const std::string& pattern) { return matches(pattern, surface.patch_names[p]); };
      if (std::any_of(entry.patches.begin(), entry.patches.end(), names_it)) layers[p] = entry.count.value_or(kDefaultLayers);
    }
  return layers;
}

void price(Estimate& estimate, double hexes, double most_at_once) {
  estimate.hexes = static_cast<std::int64_t>(hexes);
  estimate.memory_bytes = static_cast<std::int64_t>(kBytesPerHex * std::max(hexes, most_at_once));
  estimate.cpu_seconds = kCpuSecondsPerHex * hexes;
}

}  // namespace

Estimate estimate_of(std::int64_t triangles, const Octree& octree, const MeshSpec& spec) {
  Estimate estimate;
  estimate.triangles = triangles;
  estimate.octree_cells = static_cast<std::int64_t>(octree.block_count()) * 8;
  const auto dual_hexes = static_cast<double>(count_dual_hexes(octree));
  double layer_count = 0;
  for (const LayerSpec& l : spec.layers) layer_count = std::max(layer_count, static_cast<double>(l.count.value_or(kDefaultLayers)));
  const double cut_cells = 4.0 * static_cast<double>(std::count(octree.cut.begin(), octree.cut.end(), 1));
  const double hexes = kMeshedShareOfDual * dual_hexes + layer_count * cut_cells;
  price(estimate, hexes, dual_hexes);
  return estimate;
}

Estimate count_hexes(Estimate estimate, const HexMesh& carved, const Surface& surface, const Locator& locator, const MeshSpec& spec) {
  const IdMap<PatchId, std::int64_t> layers = layers_of_patches(spec, surface);
  const IdMap<QuadId, QuadSides> sides = quad_sides(carved);
  const std::int64_t laid = parallel_reduce(
      carved.quads.size(), std::int64_t{0},
      [&](std::size_t i) {
        const QuadId q(i);
        Vec3 centre = Vec3::Zero();
        for (VertexId v : carved.quads[q]) centre += 0.25 * carved.position[v];
        const std::int64_t on_a_side = 1 + layers[surface.patch[locator.closest(centre).triangle]];
        return on_a_side * (sides[q].front.valid() ? 2 : 1);
      },
      [](std::int64_t a, std::int64_t b) { return a + b; });
  const double most_at_once = static_cast<double>(estimate.memory_bytes) / kBytesPerHex;
  price(estimate, static_cast<double>(static_cast<std::int64_t>(carved.hexes.size()) + laid), most_at_once);
  return estimate;
}

}  // namespace strata
