// The last part of growing: sheets are cut into layers, and once more where a layer would not be positive.
#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <utility>

#include "core/base/parallel.h"
#include "core/layers/grower.h"
#include "core/layers/guard.h"
#include "core/layers/heal.h"
#include "core/mesh/hex.h"

namespace strata {
namespace {

constexpr double kCramped = 0.1;          // of a hex's shortest edge
constexpr int kCuts = 8;                  // trials: each cuts more columns alike
constexpr int kAlikeSweeps = 40;
constexpr std::uint8_t kWedgeRings = 3;   // of vertices round wedge hexes, that the polish leaves alone
constexpr double kPoorLayers = 0.06;      // scaled Jacobian: layers under it are polished, at the cost of their heights

Vec3 corner_of(const HexMesh& mesh, HexId h, std::size_t i) { return mesh.position[mesh.hexes[h][i]]; }

// Pieces of hexes that are far narrower along the sheets than the hex: points put back on the ground came to lie on each other.
std::vector<HexId> cramped(const Sliced& sliced, const HexMesh& coarse, const Guard& guard) {
  const auto shortest = [](const HexMesh& mesh, HexId h, std::size_t axis) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t e = axis * 4; e < axis * 4 + 4; ++e)
      least = std::min(least, (corner_of(mesh, h, static_cast<std::size_t>(kHexEdges[e][1])) -
                               corner_of(mesh, h, static_cast<std::size_t>(kHexEdges[e][0])))
                                  .norm());
    return least;
  };
  std::vector<std::uint8_t> is_cramped(sliced.mesh.hexes.size(), 0);
  parallel_for(is_cramped.size(), [&](std::size_t i) {
    const HexId h(i), parent = sliced.parent[h];
    if (!parent.valid() || !guard.crossed(parent)) return;
    std::array<bool, 3> cut{};
    for (const Guard::Crossing& crossing : guard.crossings(parent)) cut[static_cast<std::size_t>(crossing.axis)] = true;
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (!cut[axis] && shortest(sliced.mesh, h, axis) < kCramped * shortest(coarse, parent, axis)) is_cramped[i] = 1;
  });
  std::vector<HexId> result;
  for (std::size_t i = 0; i < is_cramped.size(); ++i)
    if (is_cramped[i] != 0) result.emplace_back(i);
  return result;
}

// Of wedge hexes and what is near: no better places are known for these than the cut gave, and no polish may look for them.
std::vector<VertexId> round_wedges(const HexMesh& mesh, const Sliced& sliced) {
  IdMap<VertexId, std::uint8_t> near(mesh.position.size(), 0);
  for (HexId h : mesh.hexes.ids())
    for (std::size_t i = 0; sliced.prism[h] >= 0 && i < 8; ++i) near[mesh.hexes[h][i]] = 1;
  for (std::uint8_t ring = 1; ring <= kWedgeRings; ++ring)
    for (HexId h : mesh.hexes.ids())
      if (std::any_of(mesh.hexes[h].begin(), mesh.hexes[h].end(), [&](VertexId v) { return near[v] == ring; }))
        for (VertexId v : mesh.hexes[h])
          if (near[v] == 0) near[v] = ring + 1;
  std::vector<VertexId> result;
  for (VertexId v : mesh.position.ids())
    if (near[v] != 0) result.push_back(v);
  return result;
}

}  // namespace

std::vector<Stack> Grower::stacks() {
  std::vector<Stack> result;
  fraction.assign(mesh.position.size(), -1);
  for (std::size_t i = 0; i < sheets_.size(); ++i) {
    const GroupSheet& s = sheets_[i];
    Stack& stack = result.emplace_back();
    stack.columns = s.growing.columns;
    stack.cells = plan.groups[static_cast<std::size_t>(s.group)].count + s.blending;
    stack.prisms = s.growing.prisms;
    const auto cells = static_cast<std::size_t>(stack.cells);
    stack.level.resize(cells * stack.columns.size());
    stack.straight.assign(stack.columns.size(), 0);
    for (std::size_t c = 0; c < stack.columns.size(); ++c)
      fraction[stack.columns.bottom[c]] =
          column_fractions(s.laws[c], height_of(mesh, s.growing, c), std::span(stack.level).subspan(c * cells, cells));
    even_out(stack, static_cast<std::int32_t>(i));
  }
  return result;
}

// A hex whose columns are cut at equal fractions is cut along its own coordinates: its layers are as positive as itself.
void Grower::even_out(Stack& stack, std::int32_t sheet) {
  const GroupSheet& s = sheets_[static_cast<std::size_t>(sheet)];
  const auto cells = static_cast<std::size_t>(stack.cells);
  std::vector<double> sum(stack.level.size());
  std::vector<int> count(stack.columns.size());
  for (int sweep = 0; sweep < kAlikeSweeps; ++sweep) {
    std::fill(sum.begin(), sum.end(), 0.0);
    std::fill(count.begin(), count.end(), 0);
    for (const Alike& four : alike_) {
      if (four.sheet != sheet) continue;
      for (std::size_t k = 0; k < cells; ++k) {
        double mean = 0;
        for (const std::int32_t c : four.column) mean += 0.25 * stack.level[static_cast<std::size_t>(c) * cells + k];
        for (const std::int32_t c : four.column) sum[static_cast<std::size_t>(c) * cells + k] += mean;
      }
      for (const std::int32_t c : four.column) ++count[static_cast<std::size_t>(c)];
    }
    for (std::size_t c = 0; c < count.size(); ++c)
      for (std::size_t k = 0; count[c] > 0 && k < cells; ++k) stack.level[c * cells + k] = sum[c * cells + k] / count[c];
  }
  const auto last = static_cast<std::size_t>(plan.groups[static_cast<std::size_t>(s.group)].count - 1);
  for (std::size_t c = 0; c < count.size(); ++c) {
    if (count[c] == 0) continue;
    stack.straight[c] = 1;
    fraction[stack.columns.bottom[c]] = stack.level[c * cells + last] * height_of(mesh, s.growing, c) / physical_thickness(s.laws[c]);
  }
}

// The groups are joined whole: a part of one that stayed apart from the rest would have to cross it where they are flush.
void Grower::note_bad_crossing(std::span<const Guard::Crossing> crossings) {
  const auto fronts = [&](const Guard::Crossing& c) -> const std::vector<FrontIndex>& {
    return plan.groups[static_cast<std::size_t>(sheets_[static_cast<std::size_t>(c.sheet)].group)].fronts;
  };
  const auto join = [&](FrontIndex a, FrontIndex b) {
    const std::pair<FrontIndex, FrontIndex> pair = std::minmax(a, b);
    if (a != b && std::find(crossed_badly.begin(), crossed_badly.end(), pair) == crossed_badly.end()) crossed_badly.push_back(pair);
  };
  for (std::size_t i = 1; i < crossings.size(); ++i)
    for (const FrontIndex a : fronts(crossings[i - 1])) {
      join(a, fronts(crossings[i]).front());
      for (const FrontIndex b : fronts(crossings[i])) join(fronts(crossings[i - 1]).front(), b);
    }
}

// The two columns of a prism, twice each.
std::optional<Grower::Alike> Grower::prism_columns(std::int32_t prism) const {
  for (std::size_t s = 0; s < sheets_.size(); ++s) {
    const auto& prisms = sheets_[s].growing.prisms.hexes;
    const auto count = static_cast<std::int32_t>(prisms.size());
    if (prism >= count) {
      prism -= count;
      continue;
    }
    const HexVertices& hex = prisms[static_cast<std::size_t>(prism)];
    const std::size_t tip = tip_of(hex);
    const std::int32_t c = sheets_[s].growing.columns.find(hex[(tip + 2) & 3]), d = sheets_[s].growing.columns.find(hex[(tip + 3) & 3]);
    if (c < 0 || d < 0) return std::nullopt;
    return Alike{static_cast<std::int32_t>(s), {c, d, c, d}};
  }
  return std::nullopt;
}

void Grower::cut() {
  const HexMesh coarse = mesh;
  const Guard guard(coarse, growing());
  for (int round = 0;; ++round) {
    Sliced sliced = slice(coarse, stacks(), request_.ground);
    const std::vector<HexId> bad = not_positive(sliced.mesh);
    const std::size_t known = alike_.size();
    for (const std::vector<HexId>& hexes : {bad, cramped(sliced, coarse, guard)}) {
      HexId last;
      std::int32_t last_prism = -1;
      for (HexId h : hexes) {
        if (const HexId parent = sliced.parent[h]; parent.valid() && parent != last) {
          last = parent;
          for (const Guard::Crossing& crossing : guard.crossings(parent)) alike_.push_back({crossing.sheet, crossing.column});
        }
        if (const std::int32_t p = sliced.prism[h]; p >= 0 && p != last_prism) {
          last_prism = p;
          if (const auto four = prism_columns(p)) alike_.push_back(*four);
        }
      }
    }
    if (round == kCuts || alike_.size() == known) {
      mesh = heal(std::move(sliced.mesh), {}, Soundness::Positive, request_.ground, context_);
      const std::vector<VertexId> still = round_wedges(mesh, sliced);
      mesh = polish_poorest(std::move(mesh), kPoorLayers, Losses::TakenBack, still, request_.ground, context_);
      for (HexId h : not_positive(mesh))
        if (sliced.parent[h].valid()) note_bad_crossing(guard.crossings(sliced.parent[h]));
      fraction.resize(mesh.position.size(), -1);
      return;
    }
  }
}

}  // namespace strata
