#include "core/layers/inflate.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex.h"
#include "core/optimise/optimise.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kOpening = 0.04;        // of the local size: thin enough never to fold the hexes above a sound surface quad
constexpr double kLeastQuality = 0.12;   // scaled Jacobian that a step may not go below
constexpr double kGoodQuality = 0.4;     // nor below this for the sake of blending layers
constexpr double kStep = 0.45;           // of the local size: what the hexes above can give at once
constexpr double kArrived = 0.02;        // of the thickness
constexpr double kMostLean = 4;          // column length over height that is believed
constexpr double kProgress = 0.04;       // of the thickness: less in one round is not worth another
constexpr double kStragglers = 0.005;    // of all tops: so few are not worth another round
constexpr double kProjectQuality = 0.15; // that drawing a held vertex to its ground may not cost
constexpr int kHalvings = 4;
constexpr int kFreeRounds = 3;           // of optimising with tops and bottoms free, before tops are placed
enum class Placing { Free, Exact };      // of the ends of active columns
constexpr int kRings = 6;                // of vertices round the sheet that give way
constexpr int kSweeps = 3;               // of the optimiser between steps

std::array<Vec3, 8> corners_of(const HexMesh& mesh, HexId h) {
  std::array<Vec3, 8> c;
  for (std::size_t i = 0; i < 8; ++i) c[i] = mesh.position[mesh.hexes[h][i]];
  return c;
}

double worst_round(const HexMesh& mesh, const VertexStars<HexId>& stars, VertexId v) {
  double worst = 1;
  for (HexId h : stars.of(v)) worst = std::min(worst, corner_scaled_jacobian(corners_of(mesh, h)));
  return worst;
}

// Where a top is to go: over its one bottom, or, in a crossing, to the corner of the parallelogram of the points beside it.
struct Goal {
  VertexId top;
  int sheets = 0;
  std::array<VertexId, 2> bottom;   // in the first two sheets it is a top of
  VertexId common;                  // below both
  Vec3 offset = Vec3::Zero();       // from the bottom, when there is one only
  double step = 0;                  // longest move at once
  double thickness = 0;
  double needed = 0;                // distance from the bottom that is worth a poorer hex
  bool active = false;
};

std::vector<Goal> goals_of(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, const std::vector<std::uint8_t>& active) {
  IdMap<VertexId, std::int32_t> slot(mesh.position.size(), -1);
  std::vector<Goal> goals;
  std::vector<std::array<std::int32_t, 2>> sheet_of;
  for (std::size_t s = 0; s < sheets.size(); ++s)
    for (std::size_t c = 0; c < sheets[s].columns.size(); ++c) {
      const VertexId top = sheets[s].columns.top[c];
      if (slot[top] < 0) {
        slot[top] = static_cast<std::int32_t>(goals.size());
        goals.emplace_back();
        goals.back().top = top;
        sheet_of.push_back({-1, -1});
      }
      const auto g = static_cast<std::size_t>(slot[top]);
      Goal& goal = goals[g];
      const Foot& foot = sheets[s].feet[c];
      if (goal.sheets < 2) {
        goal.bottom[static_cast<std::size_t>(goal.sheets)] = sheets[s].columns.bottom[c];
        sheet_of[g][static_cast<std::size_t>(goal.sheets)] = static_cast<std::int32_t>(s);
      }
      ++goal.sheets;
      goal.offset = foot.direction * (foot.stretch * sheets[s].thickness[c]);
      const double step = kStep * foot.size;
      goal.step = goal.step > 0 ? std::min(goal.step, step) : step;
      goal.needed = sheets[s].needed[c] * foot.stretch;
      goal.thickness = std::max(goal.thickness, sheets[s].thickness[c]);
      goal.active = goal.active || active[s] != 0;
    }
  for (std::size_t g = 0; g < goals.size(); ++g) {
    if (goals[g].sheets < 2) continue;
    const std::int32_t beside = slot[goals[g].bottom[0]];
    if (beside < 0) continue;
    for (std::size_t k = 0; k < 2; ++k)
      if (sheet_of[static_cast<std::size_t>(beside)][k] == sheet_of[g][1])
        goals[g].common = goals[static_cast<std::size_t>(beside)].bottom[k];
  }
  std::erase_if(goals, [](const Goal& g) { return !g.active; });
  std::stable_sort(goals.begin(), goals.end(),
                   [](const Goal& a, const Goal& b) { return a.sheets != b.sheets ? a.sheets < b.sheets : a.top < b.top; });
  return goals;
}

Vec3 target_of(const HexMesh& mesh, const Goal& goal, const Ground& ground) {
  Vec3 p = mesh.position[goal.bottom[0]] + goal.offset;
  if (goal.common.valid()) p = mesh.position[goal.bottom[0]] + mesh.position[goal.bottom[1]] - mesh.position[goal.common];
  return ground.project(mesh.attachment[goal.top], p).position;
}

// One round of steps, in order of the goals. Returns how many tops got on and are still on their way.
std::int64_t step_tops(HexMesh& mesh, const std::vector<Goal>& goals, const VertexStars<HexId>& stars, const Ground& ground) {
  std::int64_t under_way = 0;
  for (const Goal& goal : goals) {
    const Vec3 from = mesh.position[goal.top];
    Vec3 move = target_of(mesh, goal, ground) - from;
    const double distance = move.norm();
    if (distance <= 0) continue;
    if (distance > goal.step) move *= goal.step / distance;
    const double before = worst_round(mesh, stars, goal.top);
    const bool enough = !goal.common.valid() && (from - mesh.position[goal.bottom[0]]).norm() >= goal.needed;
    const double floor = enough ? kGoodQuality : kLeastQuality;
    bool moved = false;
    for (int k = 0; k < kHalvings && !moved; ++k, move *= 0.5) {
      mesh.position[goal.top] = ground.project(mesh.attachment[goal.top], from + move).position;
      const double after = worst_round(mesh, stars, goal.top);
      moved = after > 0 ? after >= std::min(floor, before) : after > before;
    }
    if (!moved) mesh.position[goal.top] = from;
    const double left = (target_of(mesh, goal, ground) - mesh.position[goal.top]).norm();
    under_way += left > kArrived * goal.thickness && distance - left > kProgress * goal.thickness;
  }
  return under_way;
}

// Sheets keep the thickness they are to have, the rest wants cubes.
IdMap<HexId, HexTarget> targets_of(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, const VertexStars<HexId>& stars) {
  IdMap<HexId, HexTarget> targets(mesh.hexes.size(), HexTarget{1, 1, 1});
  for (const GrowingSheet& sheet : sheets)
    for (std::size_t c = 0; c < sheet.columns.size(); ++c) {
      const VertexId bottom = sheet.columns.bottom[c], top = sheet.columns.top[c];
      const auto length = static_cast<float>(sheet.thickness[c] * sheet.feet[c].stretch / sheet.feet[c].size);
      for (HexId h : stars.of(bottom)) {
        const HexVertices& hex = mesh.hexes[h];
        for (std::size_t e = 0; e < 12; ++e) {
          const VertexId a = hex[static_cast<std::size_t>(kHexEdges[e][0])], b = hex[static_cast<std::size_t>(kHexEdges[e][1])];
          if ((a == bottom && b == top) || (a == top && b == bottom)) targets[h][e / 4] = length;
        }
      }
    }
  return targets;
}

}  // namespace

HexMesh open_sheet(HexMesh mesh, const GrowingSheet& sheet, const Ground& ground) {
  std::vector<Vec3> at(sheet.columns.size());
  for (std::size_t c = 0; c < at.size(); ++c) {
    const Foot& foot = sheet.feet[c];
    const double lift = foot.stretch * std::min(sheet.thickness[c], kOpening * foot.size);
    at[c] = ground.project(mesh.attachment[sheet.columns.top[c]], mesh.position[sheet.columns.bottom[c]] + lift * foot.direction).position;
  }
  for (std::size_t c = 0; c < at.size(); ++c) mesh.position[sheet.columns.top[c]] = at[c];
  return mesh;
}

namespace {

// Vertices that may move: all but what is held for good, and, where `placed`, the ends of active columns.
IdMap<VertexId, std::uint8_t> movable_vertices(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets,
                                               const std::vector<std::uint8_t>& active, const VertexStars<HexId>& stars, Placing placing) {
  IdMap<VertexId, std::uint8_t> movable(mesh.position.size(), 1);
  for (VertexId v : movable.ids())
    if (mesh.attachment[v].hold == Hold::Corner || mesh.attachment[v].hold == Hold::Fixed || stars.of(v).empty()) movable[v] = 0;
  if (placing == Placing::Free) return movable;
  for (std::size_t s = 0; s < sheets.size(); ++s)
    for (std::size_t c = 0; active[s] && c < sheets[s].columns.size(); ++c)
      movable[sheets[s].columns.bottom[c]] = movable[sheets[s].columns.top[c]] = 0;
  return movable;
}

IdMap<VertexId, std::uint8_t> tops_of(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets,
                                      const std::vector<std::uint8_t>& active) {
  IdMap<VertexId, std::uint8_t> tops(mesh.position.size(), 0);
  for (std::size_t s = 0; s < sheets.size(); ++s)
    for (std::size_t c = 0; active[s] && c < sheets[s].columns.size(); ++c) tops[sheets[s].columns.top[c]] = 1;
  return tops;
}

}  // namespace

HexMesh relax(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const std::vector<std::uint8_t>& active, const Ground& ground,
              Context& context) {
  const VertexStars<HexId> stars = hexes_round_vertices(mesh);
  const IdMap<HexId, HexTarget> targets = targets_of(mesh, sheets, stars);
  const IdMap<VertexId, std::uint8_t> movable = movable_vertices(mesh, sheets, active, stars, Placing::Free);
  const IdMap<VertexId, std::uint8_t> seeds = tops_of(mesh, sheets, active);
  OptimiseRequest request;
  request.ground = &ground;
  request.movable = &movable;
  request.seeds = &seeds;
  request.targets = &targets;
  OptimiseOptions options;
  options.sweeps = kFreeRounds * kSweeps;
  options.rings = kRings;
  options.min_scaled_jacobian = kProjectQuality;
  return optimise(std::move(mesh), request, options, context).mesh;
}

HexMesh inflate(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const std::vector<std::uint8_t>& active, const Ground& ground,
                int rounds, Context& context) {
  const std::vector<Goal> goals = goals_of(mesh, sheets, active);
  const VertexStars<HexId> stars = hexes_round_vertices(mesh);
  const IdMap<HexId, HexTarget> targets = targets_of(mesh, sheets, stars);
  const IdMap<VertexId, std::uint8_t> movable = movable_vertices(mesh, sheets, active, stars, Placing::Exact);
  const IdMap<VertexId, std::uint8_t> seeds = tops_of(mesh, sheets, active);
  OptimiseRequest request;
  request.ground = &ground;
  request.movable = &movable;
  request.seeds = &seeds;
  request.targets = &targets;
  OptimiseOptions options;
  options.sweeps = kSweeps;
  options.rings = kRings;
  options.min_scaled_jacobian = kProjectQuality;
  for (int round = 0; round < rounds; ++round) {
    context.checkpoint();
    const std::int64_t under_way = step_tops(mesh, goals, stars, ground);
    mesh = optimise(std::move(mesh), request, options, context).mesh;
    if (static_cast<double>(under_way) <= kStragglers * static_cast<double>(goals.size())) break;
  }
  return mesh;
}

double height_of(const HexMesh& mesh, const GrowingSheet& sheet, std::size_t column) {
  const Vec3 edge = mesh.position[sheet.columns.top[column]] - mesh.position[sheet.columns.bottom[column]];
  // A column that leans too far is counted by its length: never a height near nothing.
  return std::max(edge.dot(sheet.feet[column].normal), edge.norm() / kMostLean);
}

}  // namespace strata
