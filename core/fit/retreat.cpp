#include "core/fit/retreat.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/fit/fit.h"

namespace strata {
namespace {

constexpr double kHalf = 0.5;
constexpr double kLeastShare = 0.05;  // of the way: less is none

}  // namespace

Retreat retreat(const HexMesh& start, HexMesh fitted) {
  Retreat result;
  const IdMap<VertexId, Vec3> goal = fitted.position;
  IdMap<VertexId, double> share(goal.size(), 1.0);
  std::vector<HexId> bad = bad_hexes(fitted);
  for (bool again = !bad.empty(); again;) {
    std::vector<VertexId> back;
    for (HexId h : bad)
      for (VertexId v : fitted.hexes[h])
        if (share[v] > 0) back.push_back(v);
    std::sort(back.begin(), back.end());
    back.erase(std::unique(back.begin(), back.end()), back.end());
    for (VertexId v : back) {
      share[v] = share[v] * kHalf < kLeastShare ? 0 : share[v] * kHalf;
      fitted.position[v] = start.position[v] + share[v] * (goal[v] - start.position[v]);
    }
    bad = bad_hexes(fitted);
    again = !bad.empty() && !back.empty();
  }
  IdMap<VertexId, std::uint8_t> counted(goal.size(), std::uint8_t{0});
  for (const QuadVertices& quad : fitted.quads)
    for (VertexId v : quad) {
      if (share[v] < 1 && counted[v] == 0) ++result.moved;
      counted[v] = 1;
    }
  result.bad = static_cast<std::int64_t>(bad.size());
  result.mesh = std::move(fitted);
  return result;
}

}  // namespace strata
