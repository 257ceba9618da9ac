#include "core/dual/transition.h"

#include <algorithm>
#include <cassert>

#include "core/base/parallel.h"
#include "core/dual/templates.h"

namespace strata {
namespace {

constexpr int kBlock = 2 * kCell;         // the block's edge in template units
constexpr int kQuarter = kBlock / kQuarters;

struct BlockPoint {
  int x, y, z;
  int operator[](std::size_t axis) const { return axis == 0 ? x : axis == 1 ? y : z; }
  friend auto operator<=>(const BlockPoint&, const BlockPoint&) = default;
};
using Cell = std::vector<BlockPoint>;     // a sub-cell by its vertices

// The two other axes of an axis, ascending.
constexpr std::array<std::array<unsigned, 2>, 3> kOthers{{{1, 2}, {0, 2}, {0, 1}}};

int edge_number(unsigned axis, unsigned cell) {
  return static_cast<int>(4 * axis + (cell >> kOthers[axis][0] & 1) + 2 * (cell >> kOthers[axis][1] & 1));
}
int face_number(unsigned axis, unsigned cell) { return static_cast<int>(2 * axis + (cell >> axis & 1)); }

struct CellAsk {
  std::uint8_t faces = 0, edges = 0;
};

// What one of the eight cells sees of the block's bits.
CellAsk asked_of_cell(PatternBits bits, unsigned cell) {
  CellAsk ask;
  for (unsigned axis = 0; axis < 3; ++axis)
    if (bits & face_bit(face_number(axis, cell))) ask.faces = static_cast<std::uint8_t>(ask.faces | 1u << axis);
  for (unsigned axis = 0; axis < 3; ++axis) {
    const bool touches_fine_face = (ask.faces & ~(1u << axis)) != 0;
    if (!touches_fine_face && bits & edge_bit(edge_number(axis, cell))) ask.edges = static_cast<std::uint8_t>(ask.edges | 1u << axis);
  }
  return ask;
}

// Backtracking over the eight cells; the inner faces must show the same drawing on both sides. Placements are tried in their order,
// fewest sub-cells first, so that nothing is cut that need not be.
bool place(const std::vector<Placement>& placements, const std::array<CellAsk, 8>& ask, unsigned cell,
           std::array<const Placement*, 8>& chosen) {
  if (cell == 8) return true;
  for (const Placement& candidate : placements) {
    if (candidate.faces != ask[cell].faces || candidate.edges != ask[cell].edges) continue;
    bool fits = true;
    for (unsigned axis = 0; axis < 3 && fits; ++axis)
      if (cell >> axis & 1) fits = chosen[cell ^ 1u << axis]->inner_face[axis] == candidate.inner_face[axis];
    if (!fits) continue;
    chosen[cell] = &candidate;
    if (place(placements, ask, cell + 1, chosen)) return true;
  }
  return false;
}

std::vector<Cell> cells_of(const std::array<const Placement*, 8>& chosen) {
  std::vector<Cell> cells;
  for (unsigned c = 0; c < 8; ++c) {
    const auto mirrored = [c](const CellPoint& p, unsigned axis) { return c >> axis & 1 ? kBlock - p[axis] : int{p[axis]}; };
    for (const SubCell& sub_cell : chosen[c]->cells) {
      Cell& cell = cells.emplace_back();
      for (const CellPoint& p : sub_cell) cell.push_back({mirrored(p, 0), mirrored(p, 1), mirrored(p, 2)});
      std::sort(cell.begin(), cell.end());
    }
  }
  return cells;
}

Vec3 mean(const Cell& cell) {
  Vec3 sum = Vec3::Zero();
  for (const BlockPoint& p : cell) sum += Vec3(p.x, p.y, p.z);
  return sum / (static_cast<double>(cell.size()) * kBlock);
}

// Two sub-cells share a face when they share three vertices or more.
bool share_face(const Cell& a, const Cell& b) {
  std::size_t shared = 0;
  for (const BlockPoint& p : a) shared += std::binary_search(b.begin(), b.end(), p) ? 1u : 0u;
  return shared >= 3;
}

using Corners = std::array<std::int8_t, 8>;

// Numbers the eight sub-cells round an interior vertex as the corners of a positive hex: the face adjacency is a cube's graph.
Corners cube_order(const std::vector<std::int8_t>& round, const std::vector<Cell>& cells, const std::vector<Vec3>& node) {
  const auto at = [&](std::int8_t c) -> const Vec3& { return node[static_cast<std::size_t>(c)]; };
  const auto joined = [&](std::int8_t a, std::int8_t b) {
    return share_face(cells[static_cast<std::size_t>(a)], cells[static_cast<std::size_t>(b)]);
  };
  const std::int8_t first = *std::min_element(round.begin(), round.end(), [&](auto a, auto b) { return at(a).sum() < at(b).sum(); });
  std::vector<std::int8_t> next;
  for (const std::int8_t c : round)
    if (c != first && joined(c, first)) next.push_back(c);
  assert(next.size() == 3 && "an interior vertex of a pattern has an octahedral link");
  // x, y, z by the direction that fits best, so that hexes lie as upright as the template allows
  for (int axis = 0; axis < 2; ++axis)
    std::iter_swap(next.begin() + axis,
                   std::max_element(next.begin() + axis, next.end(), [&](auto a, auto b) { return at(a)[axis] < at(b)[axis]; }));
  const Vec3 e0 = at(next[0]) - at(first), e1 = at(next[1]) - at(first), e2 = at(next[2]) - at(first);
  if (e0.cross(e1).dot(e2) < 0) std::swap(next[0], next[1]);

  const auto second = [&](std::int8_t a, std::int8_t b) {
    for (const std::int8_t c : round)
      if (c != first && c != a && c != b && joined(c, a) && joined(c, b)) return c;
    return std::int8_t{-1};
  };
  Corners hex{first, next[0], second(next[0], next[1]), next[1], next[2], second(next[0], next[2]), -1, second(next[1], next[2])};
  for (const std::int8_t c : round)
    if (std::find(hex.begin(), hex.end(), c) == hex.end()) hex[6] = c;
  assert(std::find(hex.begin(), hex.end(), -1) == hex.end() && "the eight sub-cells round a vertex form a cube graph");
  return hex;
}

bool on_hull(int v) { return v == 0 || v == kBlock; }

// The mean, along an axis, of a sub-cell's vertices that lie on all the hull planes (edge or face of the block) that p lies on.
double mean_on_hull(const Cell& cell, const BlockPoint& p, std::size_t along) {
  double sum = 0;
  int count = 0;
  for (const BlockPoint& q : cell) {
    bool same = true;
    for (std::size_t axis = 0; axis < 3; ++axis) same = same && (!on_hull(p[axis]) || q[axis] == p[axis]);
    if (!same) continue;
    sum += q[along];
    ++count;
  }
  return sum / count;
}

// Shares the octants round a boundary vertex among its sub-cells. On a face, the four polygons round p go two by two to the low and
// the high side of the first axis, and each pair likewise along the second; on an edge of the block there are two.
void fill_octants(const BlockPoint& p, std::vector<std::int8_t> round, const std::vector<Cell>& cells, std::array<std::int8_t, 8>& octant) {
  unsigned fixed = 0;
  std::array<std::size_t, 2> free{};
  std::size_t free_count = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (p[axis] == 0) fixed |= 1u << axis;
    if (!on_hull(p[axis])) free[free_count++] = axis;
  }
  assert(round.size() == std::size_t{1} << free_count && "a block shows 4 cells on a face, 2 on an edge, 1 at a corner");
  const auto sort_along = [&](std::size_t axis, std::ptrdiff_t begin, std::ptrdiff_t end) {
    std::sort(round.begin() + begin, round.begin() + end, [&](std::int8_t a, std::int8_t b) {
      const double u = mean_on_hull(cells[static_cast<std::size_t>(a)], p, axis);
      const double v = mean_on_hull(cells[static_cast<std::size_t>(b)], p, axis);
      return u != v ? u < v : a < b;
    });
  };
  const auto size = static_cast<std::ptrdiff_t>(round.size());
  if (free_count > 0) sort_along(free[0], 0, size);
  if (free_count > 1) {
    sort_along(free[1], 0, size / 2);
    sort_along(free[1], size / 2, size);
  }
  for (std::size_t i = 0; i < round.size(); ++i) {
    unsigned bits = fixed;
    for (std::size_t f = 0; f < free_count; ++f)
      if (i >> (free_count - 1 - f) & 1) bits |= 1u << free[f];
    octant[bits] = round[i];
  }
}

Pattern pattern_of(const std::vector<Cell>& cells) {
  Pattern pattern;
  for (auto& octant : pattern.octant) octant.fill(-1);
  for (const Cell& cell : cells) pattern.node.push_back(mean(cell));

  std::vector<std::pair<BlockPoint, std::int8_t>> stars;  // (vertex, sub-cell)
  for (std::size_t c = 0; c < cells.size(); ++c)
    for (const BlockPoint& p : cells[c]) stars.emplace_back(p, static_cast<std::int8_t>(c));
  std::sort(stars.begin(), stars.end());
  for (std::size_t i = 0; i < stars.size();) {
    const BlockPoint p = stars[i].first;
    std::vector<std::int8_t> round;
    for (; i < stars.size() && stars[i].first == p; ++i) round.push_back(stars[i].second);
    if (!on_hull(p.x) && !on_hull(p.y) && !on_hull(p.z)) {
      pattern.interior.push_back(cube_order(round, cells, pattern.node));
      continue;
    }
    const LatticePoint q{static_cast<std::int8_t>(p.x / kQuarter), static_cast<std::int8_t>(p.y / kQuarter),
                         static_cast<std::int8_t>(p.z / kQuarter)};
    fill_octants(p, std::move(round), cells, pattern.octant[lattice_index(q.x, q.y, q.z)]);
    if (p.x < kBlock && p.y < kBlock && p.z < kBlock) pattern.owned.push_back(q);
  }
  return pattern;
}

}  // namespace

PatternBits with_implied_edges(PatternBits bits) {
  for (unsigned axis = 0; axis < 3; ++axis)
    for (unsigned cell = 0; cell < 8; ++cell)
      for (const unsigned other : kOthers[axis])
        if (bits & face_bit(face_number(other, cell))) bits |= edge_bit(edge_number(axis, cell));
  return bits;
}

std::vector<Pattern> solve_patterns(const std::vector<PatternBits>& bits) {
  const std::vector<Placement> placements = make_placements();
  std::vector<Pattern> patterns(bits.size());
  parallel_for(
      bits.size(),
      [&](std::size_t i) {
        std::array<CellAsk, 8> ask;
        for (unsigned cell = 0; cell < 8; ++cell) ask[cell] = asked_of_cell(bits[i], cell);
        std::array<const Placement*, 8> chosen{};
        [[maybe_unused]] const bool solved = place(placements, ask, 0, chosen);
        assert(solved && "every legal pattern has a solution (design, section 4.6)");
        patterns[i] = pattern_of(cells_of(chosen));
      },
      1);
  return patterns;
}

}  // namespace strata
