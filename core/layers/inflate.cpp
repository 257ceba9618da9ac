#include "core/layers/inflate.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/layers/open.h"
#include "core/mesh/hex.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kArrived = 0.02;        // of the thickness
constexpr double kMostLean = 4;          // column length over height that is believed
constexpr double kNotMuchWorse = 0.8;    // a poor hex may lose so much of its quality in a step
constexpr int kLateRings = 5;            // round tops that are late
constexpr double kMostOfAll = 0.9;       // of the tops: the way of the others does not count for the number of steps
constexpr int kHalvings = 4;             // of the moves round a bad hex, before they are given up for this step
constexpr int kSettleTrials = 4;
constexpr double kSettledHex = 0.15;     // scaled Jacobian that settling may not cost hexes
constexpr double kSettledPrism = 0.12;   // and prisms
constexpr double kPrismQuality = 0.12;   // scaled Jacobian that prisms need

double wanted(const GrowingSheet& sheet, std::size_t c, Reach reach) {
  return sheet.feet[c].stretch * (reach == Reach::Full ? sheet.thickness[c] : std::min(sheet.needed[c], sheet.thickness[c]));
}

// Whether a move that led from one quality to another must not be.
bool is_worse(double now, double before, double enough) {
  return !(now >= enough || (now >= (before > 0 ? kNotMuchWorse * before : before) && (now > 0 || before <= 0)));
}

}  // namespace

Inflation::Inflation(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, const Ground& ground, int rings, Burden burden)
    : ground_(&ground),
      neighbours_(mesh),
      stars_(neighbours_.star),
      guard_(mesh, sheets),
      role_(mesh.position.size(), Role::Carried),
      spread_([&] {
        IdMap<VertexId, std::int32_t> slot(mesh.position.size(), -1);
        for (std::size_t s = 0; s < sheets.size(); ++s)
          for (std::size_t c = 0; c < sheets[s].columns.size(); ++c) {
            const VertexId top = sheets[s].columns.top[c];
            if (slot[top] < 0) {
              slot[top] = static_cast<std::int32_t>(goals_.size());
              goals_.emplace_back();
              goals_.back().top = top;
            }
            Goal& goal = goals_[static_cast<std::size_t>(slot[top])];
            if (goal.sheets < 2) {
              const auto k = static_cast<std::size_t>(goal.sheets);
              goal.bottom[k] = sheets[s].columns.bottom[c];
              goal.sheet[k] = static_cast<std::int32_t>(s);
              goal.column[k] = static_cast<std::int32_t>(c);
            }
            ++goal.sheets;
            role_[sheets[s].columns.bottom[c]] = Role::Still;
          }
        for (Goal& goal : goals_) {
          if (goal.sheets < 2 || slot[goal.bottom[0]] < 0) continue;
          const Goal& beside = goals_[static_cast<std::size_t>(slot[goal.bottom[0]])];
          for (std::size_t k = 0; k < 2 && k < static_cast<std::size_t>(beside.sheets); ++k)
            if (beside.sheet[k] == goal.sheet[1]) goal.common = beside.bottom[k];
        }
        std::sort(goals_.begin(), goals_.end(),
                  [](const Goal& a, const Goal& b) { return a.sheets != b.sheets ? a.sheets < b.sheets : a.top < b.top; });
        for (VertexId v : mesh.position.ids())
          if (mesh.attachment[v].hold == Hold::Corner || mesh.attachment[v].hold == Hold::Fixed || stars_.of(v).empty())
            role_[v] = Role::Still;
        for (const Goal& goal : goals_) role_[goal.top] = Role::Driven;
        return Spread(mesh, stars_, role_, rings, burden);
      }()),
      wall_([&] {
        // Feet slide; what the volume's spread carries along bare walls anyway, and all that cannot slide, stays out of it.
        IdMap<VertexId, Role> role(mesh.position.size(), Role::Still);
        Spread::Among among{IdMap<VertexId, std::uint8_t>(mesh.position.size(), 0), {}};
        for (VertexId v : mesh.position.ids()) among.vertices[v] = mesh.attachment[v].hold != Hold::Free;
        for (const GrowingSheet& sheet : sheets)
          for (std::size_t c = 0; c < sheet.columns.size(); ++c) {
            const VertexId bottom = sheet.columns.bottom[c], top = sheet.columns.top[c];
            if (const Hold hold = mesh.attachment[bottom].hold; hold == Hold::Chart || hold == Hold::Curve) role[bottom] = Role::Carried;
            // A column does not push its own foot.
            if (among.vertices[bottom] && among.vertices[top]) among.apart.emplace_back(bottom, top);
          }
        std::sort(among.apart.begin(), among.apart.end());
        for (const Goal& goal : goals_)
          if (among.vertices[goal.top]) role[goal.top] = Role::Driven;
        return Spread(mesh, stars_, role, rings, among);
      }()) {
  for (const Goal& goal : goals_) movers_.push_back(goal.top);
  for (VertexId v : wall_.carried()) role_[v] = Role::Driven, movers_.push_back(v);
  movers_.insert(movers_.end(), spread_.carried().begin(), spread_.carried().end());
  IdMap<HexId, std::uint8_t> touched(mesh.hexes.size(), 0);
  for (VertexId v : movers_)
    for (HexId h : stars_.of(v)) touched[h] = 1;
  for (HexId h : touched.ids())
    if (touched[h] != 0) round_movers_.push_back(h);
  IdMap<VertexId, std::uint8_t> may_move = sliding_ends(mesh, sheets);
  for (VertexId v : spread_.carried()) may_move[v] = 1;
  neighbours_.choose(mesh, may_move);
}

IdMap<VertexId, std::uint8_t> Inflation::sliding_ends(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets) {
  IdMap<VertexId, std::uint8_t> result(mesh.position.size(), 0);
  for (const GrowingSheet& sheet : sheets)
    for (const std::vector<VertexId>* ends : {&sheet.columns.bottom, &sheet.columns.top})
      for (VertexId v : *ends) {
        const Hold hold = mesh.attachment[v].hold;
        result[v] = hold != Hold::Corner && hold != Hold::Fixed;
      }
  return result;
}

// Single columns stand on their feet; in a crossing a top completes the parallelogram of the points beside it.
IdMap<VertexId, Vec3> Inflation::targets(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, Reach reach) const {
  IdMap<VertexId, Vec3> target = mesh.position;
  for (const Goal& goal : goals_) {
    Vec3 p;
    if (goal.common.valid()) {
      p = target[goal.bottom[0]] + target[goal.bottom[1]] - target[goal.common];
    } else {
      const auto& sheet = sheets[static_cast<std::size_t>(goal.sheet[0])];
      const auto c = static_cast<std::size_t>(goal.column[0]);
      p = target[goal.bottom[0]] + wanted(sheet, c, reach) * sheet.feet[c].direction;
    }
    if (mesh.attachment[goal.top].hold != Hold::Free)
      p = ground_->project(mesh.attachment[goal.top], p).position + off_ground(mesh, *ground_, goal.top);
    target[goal.top] = p;
  }
  return target;
}

double Inflation::thickness_of(const Goal& goal, const std::vector<GrowingSheet>& sheets, Reach reach) {
  double thickness = 0;
  for (std::size_t k = 0; k < 2 && k < static_cast<std::size_t>(goal.sheets); ++k)
    thickness =
        std::max(thickness, wanted(sheets[static_cast<std::size_t>(goal.sheet[k])], static_cast<std::size_t>(goal.column[k]), reach));
  return thickness;
}

double Inflation::size_at(const Goal& goal, const std::vector<GrowingSheet>& sheets) {
  double size = 0;
  for (std::size_t k = 0; k < 2 && k < static_cast<std::size_t>(goal.sheets); ++k)
    size = std::max(size, sheets[static_cast<std::size_t>(goal.sheet[k])].feet[static_cast<std::size_t>(goal.column[k])].size);
  return size;
}

double Inflation::typical_way(const HexMesh& mesh, const std::vector<GrowingSheet>& sheets, Reach reach) const {
  const IdMap<VertexId, Vec3> target = targets(mesh, sheets, reach);
  std::vector<double> ways;
  for (const Goal& goal : goals_) {
    const double size = size_at(goal, sheets);
    if (size > 0) ways.push_back((target[goal.top] - mesh.position[goal.top]).norm() / size);
  }
  if (ways.empty()) return 0;
  const auto at = ways.begin() + static_cast<std::ptrdiff_t>(kMostOfAll * static_cast<double>(ways.size() - 1));
  std::nth_element(ways.begin(), at, ways.end());
  return *at;
}

HexMesh Inflation::move_safely(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const IdMap<VertexId, Vec3>& move,
                               const Step& step) const {
  const double floor = step.floor;
  const IdMap<VertexId, Vec3> from = mesh.position;
  IdMap<HexId, std::uint8_t> dirty(mesh.hexes.size(), 0);
  std::vector<HexId> check = round_movers_;
  // What a hex was worth before is asked only of those that have become poor.
  const auto has_become_worse = [&](HexId h) {
    const double now = guard_.quality(mesh, sheets, h);
    return now < floor && is_worse(now, guard_.quality(mesh.hexes[h], from, sheets, h), floor);
  };
  const std::vector<Guard::Prism>& prisms = guard_.prisms();
  std::vector<double> prism_before;
  for (const Guard::Prism& prism : prisms) prism_before.push_back(Guard::prism_quality(mesh, prism));
  IdMap<VertexId, float> factor(mesh.position.size(), 1.0F);
  IdMap<VertexId, std::uint8_t> moves(mesh.position.size(), 0);   // 1: may; 2: is on the list of this round
  for (VertexId v : movers_) moves[v] = 1;
  std::vector<VertexId> changed = movers_;
  IdMap<VertexId, Vec3> off(mesh.position.size(), Vec3::Zero());
  parallel_for(movers_.size(), [&](std::size_t i) { off[movers_[i]] = off_ground(mesh, *ground_, movers_[i]); });
  for (int round = 0; !changed.empty(); ++round) {
    parallel_for(changed.size(), [&](std::size_t i) {
      const VertexId v = changed[i];
      mesh.position[v] = from[v] + static_cast<double>(factor[v]) * move[v];
      if (factor[v] > 0 && mesh.attachment[v].hold != Hold::Free)
        mesh.position[v] = ground_->project(mesh.attachment[v], mesh.position[v]).position + off[v];
    });
    std::vector<std::uint8_t> bad(check.size(), 0);
    parallel_for(check.size(), [&](std::size_t i) { bad[i] = has_become_worse(check[i]); });
    changed.clear();
    for (std::size_t i = 0; i < prisms.size(); ++i) {
      if (!is_worse(Guard::prism_quality(mesh, prisms[i]), prism_before[i], kPrismQuality)) continue;
      for (VertexId v : prisms[i])
        if (factor[v] > 0 && moves[v] == 1) moves[v] = 2, changed.push_back(v);
    }
    for (std::size_t i = 0; i < check.size(); ++i) {
      if (!bad[i]) continue;
      for (VertexId v : mesh.hexes[check[i]])
        if (factor[v] > 0 && moves[v] == 1) moves[v] = 2, changed.push_back(v);
    }
    for (VertexId v : changed) factor[v] = round < kHalvings ? 0.5F * factor[v] : 0.0F;
    // Whoever holds back draws the vertices round it back a little less: a sudden step would fold the next hexes.
    for (std::size_t i = 0; i < changed.size(); ++i) {
      const float most = factor[changed[i]] + step.ahead;
      if (most >= 1) continue;
      for (HexId h : stars_.of(changed[i]))
        for (VertexId w : mesh.hexes[h]) {
          if (moves[w] == 0 || factor[w] <= most) continue;
          factor[w] = most;
          changed.push_back(w);
        }
    }
    std::sort(changed.begin(), changed.end());
    changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
    for (VertexId v : changed) {
      moves[v] = 1;
      for (HexId h : stars_.of(v)) dirty[h] = 1;
    }
    check.clear();
    for (VertexId v : changed)
      for (HexId h : stars_.of(v))
        if (dirty[h] == 1) dirty[h] = 2, check.push_back(h);
  }
  return mesh;
}

HexMesh Inflation::settle(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const Step& step, const std::vector<VertexId>& late,
                          Context& context) const {
  IdMap<VertexId, std::uint8_t> movable =
      step.settle == Settle::Along ? sliding_ends(mesh, sheets) : IdMap<VertexId, std::uint8_t>(mesh.position.size(), 0);
  for (VertexId v : spread_.carried()) movable[v] = 1;
  OptimiseRequest request;
  request.neighbours = &neighbours_;
  request.ground = ground_;
  request.movable = &movable;
  IdMap<HexId, HexTarget> targets;
  if (step.settle == Settle::Along) {
    targets = guard_.targets(sheets);
    request.targets = &targets;
  }
  OptimiseOptions options;
  options.sweeps = step.sweeps;
  options.min_scaled_jacobian = kSettledHex;
  options.project = false;  // what the fit left off its ground stays off: thin columns would not survive that one end goes there
  IdMap<VertexId, std::uint8_t> seeds;
  if (step.late_only) {
    if (late.empty()) return mesh;
    seeds.assign(mesh.position.size(), 0);
    for (VertexId top : late)
      for (HexId h : stars_.of(top))
        for (VertexId v : mesh.hexes[h]) seeds[v] = movable[v];
    request.seeds = &seeds;
    options.rings = kLateRings;
  }
  const std::vector<Guard::Prism>& prisms = guard_.prisms();
  if (prisms.empty()) return optimise(std::move(mesh), request, options, context).mesh;
  // The optimiser does not see prisms: those it would spoil stay where they are.
  std::vector<double> before;
  for (const Guard::Prism& prism : prisms) before.push_back(Guard::prism_quality(mesh, prism));
  for (int trial = 0;; ++trial) {
    HexMesh settled = optimise(mesh, request, options, context).mesh;
    bool spoilt = false;
    for (std::size_t i = 0; i < prisms.size(); ++i) {
      const bool still = trial + 1 >= kSettleTrials;
      if (!still && !is_worse(Guard::prism_quality(settled, prisms[i]), before[i], kSettledPrism)) continue;
      for (VertexId v : prisms[i]) spoilt = spoilt || movable[v] != 0, movable[v] = 0;
    }
    if (!spoilt) return settled;
  }
}

Inflation::Advanced Inflation::advance(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const Step& step, Context& context) const {
  context.checkpoint();
  IdMap<VertexId, Vec3> end = targets(mesh, sheets, step.reach);
  IdMap<VertexId, Vec3> move(mesh.position.size(), Vec3::Zero());
  for (const Goal& goal : goals_) {
    const Vec3 way = step.share * (end[goal.top] - mesh.position[goal.top]);
    const double length = way.norm(), most = step.stride * size_at(goal, sheets);
    move[goal.top] = length > most ? Vec3(way * (most / length)) : way;
  }
  wall_.fill(move);
  for (VertexId v : wall_.carried()) {
    const Vec3 to = ground_->project(mesh.attachment[v], mesh.position[v] + move[v]).position;
    move[v] = to + off_ground(mesh, *ground_, v) - mesh.position[v];
  }
  for (const Goal& goal : goals_) {
    // Single columns go with their feet.
    if (!goal.common.valid() && mesh.attachment[goal.top].hold == Hold::Free) move[goal.top] += move[goal.bottom[0]];
    end[goal.top] = mesh.position[goal.top] + move[goal.top];
  }
  spread_.fill(move);
  Advanced result;
  mesh = move_safely(std::move(mesh), sheets, move, step);
  std::vector<VertexId> late;
  for (const Goal& goal : goals_) {
    const double thickness = thickness_of(goal, sheets, step.reach), distance = (end[goal.top] - mesh.position[goal.top]).norm();
    if (distance > kArrived * thickness) result.left += distance / thickness, late.push_back(goal.top);
  }
  result.mesh = step.sweeps > 0 ? settle(std::move(mesh), sheets, step, late, context) : std::move(mesh);
  return result;
}

double height_of(const HexMesh& mesh, const GrowingSheet& sheet, std::size_t column) {
  const Vec3 edge = mesh.position[sheet.columns.top[column]] - mesh.position[sheet.columns.bottom[column]];
  // A column that leans too far is counted by its length: never a height near nothing.
  return std::max(edge.dot(sheet.feet[column].normal), edge.norm() / kMostLean);
}

}  // namespace strata
