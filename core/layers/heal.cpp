#include "core/layers/heal.h"

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>
#include <utility>

#include "core/base/parallel.h"
#include "core/layers/proportions.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex.h"
#include "core/mesh/part.h"
#include "core/optimise/optimise.h"
#include "core/quality/quality.h"
#include "core/quality/validity.h"

namespace strata {
namespace {

constexpr std::size_t kFew = 2000;    // bad hexes: more are not a matter of neighbourhoods
constexpr int kRounds = 8;
constexpr int kOffFeatures = 3;  // from this round on vertices may leave corners and curves,
constexpr int kOffSurface = 5;   // and from this one charts
constexpr int kRings = 4;        // of vertices that take part, one more each round
constexpr int kMargin = 1;       // rings of hexes round them that stay still
constexpr int kSweeps = 20;
constexpr double kLeastEdge = 1e-5;  // of a hex's longest
constexpr double kZeroMargin = 2;    // over what a finished mesh may not have: it still goes back to the input's frame
constexpr double kParting = 0.3;  // of the way to the neighbours' middle
constexpr int kPolishRings = 4;   // of hexes round them: polishing moves two rings of vertices
constexpr int kPolishRounds = 6;

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
    if (!(scaled_jacobian(c) > kZeroMargin * kZeroProduct)) return true;
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

IdMap<VertexId, std::uint8_t> marked(const HexMesh& mesh, const std::vector<VertexId>& vertices) {
  IdMap<VertexId, std::uint8_t> result(mesh.position.size(), 0);
  for (VertexId v : vertices) result[v] = 1;
  return result;
}

// Some hexes with what is round them, to work on alone.
struct Surroundings {
  MeshPart part;
  IdMap<VertexId, std::uint8_t> seeds, movable;  // of the part: vertices of the hexes; all that are not held fast
};
Surroundings surroundings_of(const HexMesh& mesh, const std::vector<HexId>& hexes, const IdMap<VertexId, std::uint8_t>& frozen, int rings) {
  const IdMap<VertexId, std::uint8_t> of_hexes = vertices_of(mesh, hexes);
  Surroundings result{cut_part(mesh, of_hexes, rings), {}, {}};
  for (VertexId v : result.part.whole.ids()) {
    const VertexId whole = result.part.whole[v];
    result.seeds.push_back(of_hexes[whole]);
    result.movable.push_back(frozen[whole] == 0 && result.part.mesh.attachment[v].hold != Hold::Fixed ? 1 : 0);
  }
  return result;
}

// The polish sees the corners of hexes only: those that lost inside what counts take their vertices back.
void take_back_losses(HexMesh& mesh, const IdMap<VertexId, Vec3>& before, double goal) {
  const auto lost = [&](HexId h) {
    std::array<Vec3, 8> old;
    for (std::size_t i = 0; i < 8; ++i) old[i] = before[mesh.hexes[h][i]];
    const std::array<Vec3, 8> now = corners_of(mesh, h);
    if (now == old) return false;
    return scaled_jacobian(now) < std::min(goal, scaled_jacobian(old)) || (!bernstein_positive(now) && bernstein_positive(old));
  };
  std::vector<std::uint8_t> takes_back(mesh.hexes.size());
  for (bool any = true; any;) {
    parallel_for(takes_back.size(), [&](std::size_t h) { takes_back[h] = lost(HexId(h)) ? 1 : 0; });
    any = false;
    for (HexId h : mesh.hexes.ids()) {
      if (takes_back[h.index()] == 0) continue;
      any = true;
      for (VertexId v : mesh.hexes[h]) mesh.position[v] = before[v];
    }
  }
}

}  // namespace

std::vector<HexId> not_positive(const HexMesh& mesh) { return unsound_hexes(mesh, Soundness::Positive); }

HexMesh heal(HexMesh mesh, const std::vector<VertexId>& still, Soundness goal, const Ground& ground, Context& context) {
  std::vector<HexId> bad = unsound_hexes(mesh, goal);
  if (bad.empty() || bad.size() > kFew) return mesh;
  const IdMap<VertexId, std::uint8_t> frozen = marked(mesh, still);
  IdMap<VertexId, Vec3> best = mesh.position;
  if (goal == Soundness::ToBeCut) part_coincident(mesh, bad, frozen);
  std::size_t fewest = bad.size();
  for (int round = 0; round < kRounds && !bad.empty(); ++round) {
    Surroundings near = surroundings_of(mesh, bad, frozen, kRings + round + kMargin);
    const IdMap<VertexId, Attachment> held = near.part.mesh.attachment;
    if (round >= kOffFeatures) loosen(near.part.mesh, near.seeds, round);
    for (VertexId v : near.movable.ids())
      if (near.part.mesh.attachment[v].hold == Hold::Corner) near.movable[v] = 0;
    const IdMap<HexId, HexTarget> targets = proportions(near.part.mesh);
    near.part.mesh =
        optimise_near(std::move(near.part.mesh), {near.seeds, near.movable, targets, kRings + round, kSweeps}, ground, context);
    near.part.mesh.attachment = held;
    put_back(near.part, mesh);
    bad = unsound_hexes(mesh, goal);
    if (bad.size() < fewest) fewest = bad.size(), best = mesh.position;
  }
  mesh.position = std::move(best);
  return mesh;
}

HexMesh polish_poorest(HexMesh mesh, double goal, Losses losses, const std::vector<VertexId>& still, const Ground& ground,
                       Context& context) {
  const std::vector<HexId> poor = hexes_where(mesh, [&](const std::array<Vec3, 8>& c) { return corner_scaled_jacobian(c) < goal; });
  if (poor.empty() || poor.size() > kFew) return mesh;
  Surroundings near = surroundings_of(mesh, poor, marked(mesh, still), kPolishRings);
  OptimiseRequest request;
  request.ground = &ground;
  request.movable = &near.movable;
  const IdMap<VertexId, Vec3> before = near.part.mesh.position;
  near.part.mesh = polish(std::move(near.part.mesh), request, goal, kPolishRounds, context).mesh;
  if (losses == Losses::TakenBack) take_back_losses(near.part.mesh, before, goal);
  put_back(near.part, mesh);
  return mesh;
}

}  // namespace strata
