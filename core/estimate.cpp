#include "core/estimate.h"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "core/base/parallel.h"
#include "core/layers/size_law.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

// Fitted on 29 jobs of the benchmark cases, 15 shapes with and without layers, 20 thousand to 1.6 million hexes (docs/limits.md tells how far
// they lie off).
constexpr double kHexesPerBlock = 5.7;  // without layers, for each block that is not outside for sure ...
constexpr double kHexesPerCutBlock = 2.4;  // ... and more where the surface cuts it: transitions gather there
constexpr double kQuadsPerCutBlock = 2.0;  // skin quads for each block that the surface cuts
constexpr double kBytesPerHex = 550;  // peak of the whole process, beyond
constexpr double kBytesBefore = 40e6;  // what a process takes before it has a hex
constexpr double kCpuSecondsPerHex = 34e-6;  // on a core that shares its machine

// An entry with the layers that it comes to.
struct Wish {
  const LayerSpec& entry;
  ResolvedLayers layers;
};

std::vector<Wish> wishes_of(const MeshSpec& spec) {
  std::vector<Wish> wishes;
  for (const LayerSpec& entry : spec.layers) wishes.push_back({entry, resolve(entry, "layers")});
  return wishes;
}

// Layers on a wall of cells of this size: those that were asked for, and those that lead over to the cells above.
int layers_on(const Wish& wish, double size) {
  const LayerSpec& entry = wish.entry;
  const ResolvedLayers& layers = wish.layers;
  if (entry.blending == Blending::None) return layers.count;
  if (entry.blending == Blending::Count) return layers.count + entry.blending_count;
  const ColumnLaw law{layers.first_height * (entry.relative ? size : 1), layers.growth, layers.count, 0, false};
  return law.count + blending_layers(law, size);
}

// The wish for each patch; null: none.
IdMap<PatchId, const Wish*> wishes_of_patches(const std::vector<Wish>& wishes, const Surface& surface) {
  IdMap<PatchId, const Wish*> of_patch(surface.patch_names.size(), nullptr);
  for (PatchId p : of_patch.ids())
    for (const Wish& wish : wishes) {
      const auto names_it = [&](const std::string& pattern) { return matches(pattern, surface.patch_names[p]); };
      if (std::any_of(wish.entry.patches.begin(), wish.entry.patches.end(), names_it)) of_patch[p] = &wish;
    }
  return of_patch;
}

double hexes_without_layers(const Octree& octree) {
  const auto outside = static_cast<double>(std::count(octree.outside.begin(), octree.outside.end(), 1));
  const auto cut = static_cast<double>(std::count(octree.cut.begin(), octree.cut.end(), 1));
  return kHexesPerBlock * (static_cast<double>(octree.block_count()) - outside) + kHexesPerCutBlock * cut;
}

// As if the entry with the most layers held everywhere: which block belongs to which patch is not known yet.
double layer_hexes(const Octree& octree, const MeshSpec& spec) {
  std::array<double, Octree::kMaxLevel + 1> on_a_block{};
  for (const Wish& wish : wishes_of(spec))
    for (int level = 0; level <= Octree::kMaxLevel; ++level) {
      double& most = on_a_block[static_cast<std::size_t>(level)];
      most = std::max(most, kQuadsPerCutBlock * layers_on(wish, octree.cell_size(level)));
    }
  double sum = 0;
  for (std::size_t block = 0; block < octree.block_count(); ++block)
    if (octree.cut[block] != 0) sum += on_a_block[octree.level[block]];
  return sum;
}

using Corners = std::array<Vec3, 4>;

Corners corners_of(const HexMesh& mesh, QuadId quad) {
  Corners corners;
  for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = mesh.position[mesh.quads[quad][i]];
  return corners;
}

double mean_edge(const Corners& p) {
  return 0.25 * ((p[1] - p[0]).norm() + (p[2] - p[1]).norm() + (p[3] - p[2]).norm() + (p[0] - p[3]).norm());
}

void price(Estimate& estimate, double hexes) {
  estimate.hexes = static_cast<std::int64_t>(hexes);
  estimate.memory_bytes = static_cast<std::int64_t>(kBytesBefore + kBytesPerHex * hexes);
  estimate.cpu_seconds = kCpuSecondsPerHex * hexes;
}

}  // namespace

Estimate estimate_of(std::int64_t triangles, const Octree& octree, const MeshSpec& spec) {
  Estimate estimate;
  estimate.triangles = triangles;
  estimate.octree_cells = static_cast<std::int64_t>(octree.block_count()) * 8;
  price(estimate, hexes_without_layers(octree) + layer_hexes(octree, spec));
  return estimate;
}

Estimate count_hexes(Estimate estimate, const HexMesh& carved, const Surface& surface, const Locator& locator, const MeshSpec& spec) {
  const std::vector<Wish> wishes = wishes_of(spec);
  const IdMap<PatchId, const Wish*> wish_of = wishes_of_patches(wishes, surface);
  const IdMap<QuadId, QuadSides> sides = quad_sides(carved);
  const std::int64_t laid = parallel_reduce(
      carved.quads.size(), std::int64_t{0},
      [&](std::size_t i) {
        const QuadId q(i);
        const Corners p = corners_of(carved, q);
        const Vec3 centre = 0.25 * (p[0] + p[1] + p[2] + p[3]);
        const Wish* wish = wish_of[surface.patch[locator.closest(centre).triangle]];
        const std::int64_t on_a_side = 1 + (wish == nullptr ? 0 : layers_on(*wish, mean_edge(p)));
        return on_a_side * (sides[q].front.valid() ? 2 : 1);
      },
      [](std::int64_t a, std::int64_t b) { return a + b; });
  price(estimate, static_cast<double>(static_cast<std::int64_t>(carved.hexes.size()) + laid));
  return estimate;
}

}  // namespace strata
