#include "core/layers/heal.h"

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>
#include <utility>

#include "core/base/parallel.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex.h"
#include "core/mesh/part.h"
#include "core/quality/quality.h"
#include "core/quality/validity.h"

namespace strata {
namespace {

constexpr std::size_t kFew = 2000;    // bad hexes: more are not a matter of neighbourhoods
constexpr double kNoLength = 0.0016;  // of the longest axis
constexpr int kRounds = 8;
constexpr int kOffFeatures = 3;  // from this round on vertices may leave corners and curves,
constexpr int kOffSurface = 5;   // and from this one charts
constexpr int kRings = 4;        // of vertices that take part, one more each round
constexpr int kMargin = 1;       // rings of hexes round them that stay still
constexpr int kSweeps = 20;
constexpr double kLeastEdge = 1e-5;  // of a hex's longest
constexpr double kParting = 0.3;  // of the way to the neighbours' middle
constexpr double kCalm = 0.02;   // scaled Jacobian that drawing a held vertex to its ground may not cost

std::array<Vec3, 8> corners_of(const HexMesh& mesh, HexId h) {
  std::array<Vec3, 8> c;
  for (std::size_t i = 0; i < 8; ++i) c[i] = mesh.position[mesh.hexes[h][i]];
  return c;
}

// Ascending.
template <class Wanted>
std::vector<HexId> hexes_where(const HexMesh& mesh, const Wanted& wanted) {
  std::vector<std::uint8_t> is_wanted(mesh.hexes.size(), 0);
  parallel_for(mesh.hexes.size(), [&](std::size_t h) { is_wanted[h] = wanted(corners_of(mesh, HexId(h))) ? 1 : 0; });
  std::vector<HexId> result;
  for (std::size_t h = 0; h < is_wanted.size(); ++h)
    if (is_wanted[h] != 0) result.emplace_back(h);
  return result;
}

IdMap<VertexId, std::uint8_t> vertices_of(const HexMesh& mesh, const std::vector<HexId>& hexes) {
  IdMap<VertexId, std::uint8_t> marked(mesh.position.size(), 0);
  for (HexId h : hexes)
    for (VertexId v : mesh.hexes[h]) marked[v] = 1;
  return marked;
}

bool has_short_edge(const std::array<Vec3, 8>& c) {
  double shortest = std::numeric_limits<double>::infinity(), longest = 0;
  for (const auto& edge : kHexEdges) {
    const double length = (c[static_cast<std::size_t>(edge[1])] - c[static_cast<std::size_t>(edge[0])]).norm();
    shortest = std::min(shortest, length);
    longest = std::max(longest, length);
  }
  return shortest < kLeastEdge * longest;
}

std::vector<HexId> unsound_hexes(const HexMesh& mesh, Soundness goal) {
  return hexes_where(mesh, [&](const std::array<Vec3, 8>& c) {
    if (!(corner_scaled_jacobian(c) > 0 && scaled_jacobian(c) > 0)) return true;
    return goal == Soundness::ToBeCut && (has_short_edge(c) || !bernstein_positive(c));
  });
}

// Where two vertices are next to one another, one of them goes a part of the way to the middle of its other neighbours: no small step
// would tell the optimiser where there is room.
void part_coincident(HexMesh& mesh, const std::vector<HexId>& hexes, const IdMap<VertexId, std::uint8_t>& frozen) {
  std::vector<std::pair<VertexId, VertexId>> pairs;  // who goes, from whom
  for (HexId h : hexes) {
    const std::array<Vec3, 8> c = corners_of(mesh, h);
    double longest = 0;
    for (const auto& edge : kHexEdges)
      longest = std::max(longest, (c[static_cast<std::size_t>(edge[1])] - c[static_cast<std::size_t>(edge[0])]).norm());
    for (const auto& edge : kHexEdges) {
      const auto i = static_cast<std::size_t>(edge[0]), j = static_cast<std::size_t>(edge[1]);
      if ((c[j] - c[i]).norm() >= kLeastEdge * longest) continue;
      // Holds are ordered from free to fixed.
      const auto stiffness = [&](VertexId v) { return std::make_tuple(frozen[v], mesh.attachment[v].hold, v); };
      const auto [goes, stays] =
          std::minmax({mesh.hexes[h][i], mesh.hexes[h][j]}, [&](VertexId a, VertexId b) { return stiffness(a) < stiffness(b); });
      const Hold hold = mesh.attachment[goes].hold;
      if (frozen[goes] == 0 && hold != Hold::Corner && hold != Hold::Fixed) pairs.emplace_back(goes, stays);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  if (pairs.empty()) return;
  const VertexStars<HexId> star = hexes_round_vertices(mesh);
  for (const auto& [goes, stays] : pairs) {
    Vec3 sum = Vec3::Zero();
    int count = 0;
    for (HexId h : star.of(goes))
      for (const auto& edge : kHexEdges) {
        VertexId a = mesh.hexes[h][static_cast<std::size_t>(edge[0])], b = mesh.hexes[h][static_cast<std::size_t>(edge[1])];
        if (b == goes) std::swap(a, b);
        if (a != goes || b == stays) continue;
        sum += mesh.position[b];
        ++count;
      }
    if (count > 0) mesh.position[goes] += kParting * (sum / count - mesh.position[goes]);
  }
}

void loosen(HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& near, int round) {
  for (VertexId v : near.ids()) {
    Attachment& held = mesh.attachment[v];
    if (near[v] == 0 || held.hold == Hold::Free || held.hold == Hold::Fixed) continue;
    if (round >= kOffSurface) held = {Hold::Free, -1};
    else if (held.hold != Hold::Chart) held = {Hold::Chart, kWholeSurface};
  }
}

}  // namespace

IdMap<HexId, HexTarget> proportions(const HexMesh& mesh) {
  IdMap<HexId, HexTarget> result(mesh.hexes.size());
  parallel_for(mesh.hexes.size(), [&](std::size_t i) {
    const HexVertices& hex = mesh.hexes[HexId(i)];
    std::array<double, 3> length{};
    for (std::size_t e = 0; e < 12; ++e)
      length[e / 4] += 0.25 * (mesh.position[hex[static_cast<std::size_t>(kHexEdges[e][0])]] -
                               mesh.position[hex[static_cast<std::size_t>(kHexEdges[e][1])]])
                                  .norm();
    const double least = kNoLength * *std::max_element(length.begin(), length.end());
    for (std::size_t axis = 0; axis < 3; ++axis) result[HexId(i)][axis] = static_cast<float>(std::max(length[axis], least));
  });
  return result;
}

std::vector<HexId> not_positive(const HexMesh& mesh) { return unsound_hexes(mesh, Soundness::Positive); }

HexMesh heal(HexMesh mesh, const std::vector<VertexId>& still, Soundness goal, const Ground& ground, Context& context) {
  std::vector<HexId> bad = unsound_hexes(mesh, goal);
  if (bad.empty() || bad.size() > kFew) return mesh;
  IdMap<VertexId, std::uint8_t> frozen(mesh.position.size(), 0);
  for (VertexId v : still) frozen[v] = 1;
  if (goal == Soundness::ToBeCut) part_coincident(mesh, bad, frozen);
  IdMap<VertexId, Vec3> best = mesh.position;
  std::size_t fewest = bad.size();
  for (int round = 0; round < kRounds && !bad.empty(); ++round) {
    const IdMap<VertexId, std::uint8_t> marked = vertices_of(mesh, bad);
    MeshPart part = cut_part(mesh, marked, kRings + round + kMargin);
    IdMap<VertexId, std::uint8_t> movable(part.mesh.position.size()), seeds(part.mesh.position.size());
    for (VertexId v : movable.ids()) {
      seeds[v] = marked[part.whole[v]];
      movable[v] = frozen[part.whole[v]] == 0 && part.mesh.attachment[v].hold != Hold::Fixed;
    }
    const IdMap<VertexId, Attachment> held = part.mesh.attachment;
    if (round >= kOffFeatures) loosen(part.mesh, seeds, round);
    for (VertexId v : movable.ids())
      if (part.mesh.attachment[v].hold == Hold::Corner) movable[v] = 0;
    const IdMap<HexId, HexTarget> targets = proportions(part.mesh);
    OptimiseRequest request;
    request.ground = &ground;
    request.movable = &movable;
    request.seeds = &seeds;
    request.targets = &targets;
    OptimiseOptions options;
    options.sweeps = kSweeps;
    options.rings = kRings + round;
    options.arrival_sweeps = 0;
    options.min_scaled_jacobian = kCalm;
    part.mesh = optimise(std::move(part.mesh), request, options, context).mesh;
    part.mesh.attachment = held;
    put_back(part, mesh);
    bad = unsound_hexes(mesh, goal);
    if (bad.size() < fewest) fewest = bad.size(), best = mesh.position;
  }
  mesh.position = std::move(best);
  return mesh;
}

}  // namespace strata
