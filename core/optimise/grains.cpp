#include "core/optimise/grains.h"

#include <algorithm>
#include <array>

#include "core/base/parallel.h"

namespace strata {
namespace {

constexpr std::size_t kLargest = 1024;   // vertices of a grain: with their hexes some 100 KiB
constexpr std::size_t kSmallest = 64;
constexpr std::size_t kGrainsWanted = 256;  // enough of each colour for several threads
constexpr int kCurveBits = 16;           // of each coordinate along the curve

std::uint64_t spread(std::uint64_t x) {  // bits apart by two
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  x = (x | x << 2) & 0x1249249249249249;
  return x;
}

std::vector<VertexId> along_curve(const HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& chosen) {
  std::vector<std::pair<std::uint64_t, VertexId>> keys;
  Box box;
  for (const VertexId v : mesh.position.ids())
    if (chosen[v] != 0) {
      keys.emplace_back(0, v);
      box.add(mesh.position[v]);
    }
  if (keys.empty()) return {};
  const double scale = ((1 << kCurveBits) - 1) / std::max(box.extent().maxCoeff(), 1e-300);
  parallel_for(keys.size(), [&](std::size_t i) {
    const Vec3 at = scale * (mesh.position[keys[i].second] - box.min);
    keys[i].first = spread(static_cast<std::uint64_t>(at.x())) | spread(static_cast<std::uint64_t>(at.y())) << 1 |
                    spread(static_cast<std::uint64_t>(at.z())) << 2;
  });
  parallel_sort(keys.begin(), keys.end());
  std::vector<VertexId> order(keys.size());
  parallel_for(keys.size(), [&](std::size_t i) { order[i] = keys[i].second; });
  return order;
}

// Pairs of grains that share a hex, both ways, ascending.
std::vector<std::pair<std::uint32_t, std::uint32_t>> neighbours(const HexMesh& mesh, const IdMap<VertexId, std::int32_t>& grain_of) {
  using Pair = std::pair<std::uint32_t, std::uint32_t>;
  constexpr std::size_t kBlock = 16384;
  std::vector<std::vector<Pair>> found((mesh.hexes.size() + kBlock - 1) / kBlock);
  parallel_blocks(
      mesh.hexes.size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<Pair>& pairs = found[begin / kBlock];
        for (std::size_t h = begin; h != end; ++h) {
          std::array<std::int32_t, 8> grains;
          for (std::size_t c = 0; c < 8; ++c) grains[c] = grain_of[mesh.hexes[HexId(h)][c]];
          if (std::all_of(grains.begin(), grains.end(), [&](std::int32_t g) { return g == grains[0] || g < 0; })) continue;
          for (const std::int32_t a : grains)
            for (const std::int32_t b : grains)
              if (a >= 0 && b >= 0 && a != b) pairs.emplace_back(a, b);
        }
        std::sort(pairs.begin(), pairs.end());
        pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
      },
      kBlock);
  std::vector<Pair> all;
  for (const auto& pairs : found) all.insert(all.end(), pairs.begin(), pairs.end());
  parallel_sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

}  // namespace

Grains make_grains(const HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& chosen) {
  Grains grains;
  grains.order = along_curve(mesh, chosen);
  const std::size_t count = grains.order.size(), size = std::clamp(count / kGrainsWanted, kSmallest, kLargest);
  for (std::size_t i = 0; i < count; i += size) grains.first.push_back(static_cast<std::uint32_t>(i));
  const std::size_t number = grains.first.size();
  grains.first.push_back(static_cast<std::uint32_t>(count));

  IdMap<VertexId, std::int32_t> grain_of(mesh.position.size(), -1);
  parallel_for(count, [&](std::size_t i) { grain_of[grains.order[i]] = static_cast<std::int32_t>(i / size); });
  const auto pairs = neighbours(mesh, grain_of);
  std::vector<std::int32_t> colour(number, -1);
  std::vector<std::uint32_t> taken_by;  // per colour: the grain that last saw it taken
  std::size_t at = 0;
  for (std::uint32_t g = 0; g < number; ++g) {
    for (; at < pairs.size() && pairs[at].first == g; ++at)
      if (const std::int32_t c = colour[pairs[at].second]; c >= 0) taken_by[static_cast<std::size_t>(c)] = g;
    std::size_t c = 0;
    while (c < grains.colours.size() && taken_by[c] == g) ++c;
    if (c == grains.colours.size()) {
      grains.colours.emplace_back();
      taken_by.push_back(static_cast<std::uint32_t>(number));
    }
    colour[g] = static_cast<std::int32_t>(c);
    grains.colours[c].push_back(g);
  }
  return grains;
}

}  // namespace strata
