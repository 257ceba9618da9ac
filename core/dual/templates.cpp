#include "core/dual/templates.h"

#include <algorithm>
#include <map>
#include <set>

namespace strata {
namespace {

// A cell [0,1]^3; x=0, y=0, z=0 are the block's outer faces and (1,1,1) is the block's centre. A point is three digits:
// 0 = 0, a = about 0.3 (only its side of 1/2 matters), 5 = 1/2, 1 = 1. Sub-cells are their vertex sets.
struct Template {
  std::uint8_t faces;
  std::vector<std::string_view> cells;
};

const std::array<Template, 6>& templates() {
  static const std::array<Template, 6> kTemplates{{
      // cube
      {0, {"000 100 010 110 001 101 011 111"}},
      // flat: fine face z=0; two stacked roofs with perpendicular ridges
      {4,
       {"050 010 015 550 510 51a", "550 510 51a 150 110 11a", "500 550 51a 100 105 150 11a 115",
        "000 001 050 015 011 500 550 51a 105 101 115 111"}},
      // edge: fine faces x=0 and z=0; the first roof bends round the notch
      {5,
       {"055 051 015 011 a15 a11", "550 510 51a 150 110 11a", "050 055 010 015 a15 550 510 51a", "005 001 055 051 a15 a11 501 511",
        "500 550 51a 100 105 150 11a 115", "000 005 050 055 a15 500 501 550 51a 511 105 101 115 111"}},
      // side: fine faces x=0 and z=0, next to a corner along the notch
      {5,
       {"005 001 055 051 a51 501", "055 051 015 011 a51 a11", "550 510 51a 150 110 11a", "500 550 51a 100 105 150 11a 115",
        "050 055 010 015 a51 a11 550 510 51a 511", "000 005 050 055 a51 500 501 550 51a 511 105 101 115 111"}},
      // corner: three fine faces
      {7,
       {"055 051 015 011 a51 a11", "505 501 105 101 1a5 1a1", "550 510 51a 150 110 11a", "005 001 055 051 a51 505 501 1a5 1a1 151",
        "050 055 010 015 a51 a11 550 510 51a 511", "500 505 550 51a 100 105 1a5 150 11a 115",
        "000 005 050 055 a51 500 505 550 51a 511 1a5 151 115 111"}},
      // tet at the midpoint 100 of the block's edge along x, cut off the cell that fills the corner
      {0, {"500 100 105 150"}},
  }};
  return kTemplates;
}
constexpr std::size_t kTet = 5;

std::int8_t coordinate(char digit) {
  constexpr std::int8_t kSmall = 6;  // of 20: "a"
  switch (digit) {
    case '0': return 0;
    case 'a': return kSmall;
    case '5': return kCell / 2;
    default: return kCell;
  }
}

SubCell parse(std::string_view text) {
  SubCell cell;
  for (std::size_t i = 0; i < text.size(); i += 4) cell.push_back({coordinate(text[i]), coordinate(text[i + 1]), coordinate(text[i + 2])});
  return cell;
}

using Permutation = std::array<std::size_t, 3>;
constexpr std::array<Permutation, 6> kPermutations{{{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}}};

SubCell permuted(const SubCell& cell, const Permutation& to) {
  SubCell result(cell.size());
  for (std::size_t i = 0; i < cell.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) result[i][to[axis]] = cell[i][axis];
  std::sort(result.begin(), result.end());
  return result;
}

std::uint8_t permuted(std::uint8_t bits, const Permutation& to) {
  std::uint8_t result = 0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (bits >> axis & 1) result = static_cast<std::uint8_t>(result | 1u << to[axis]);
  return result;
}

// Cuts a tet off at the end of the block's edge along `axis`: the cell that holds the edge's midpoint gets the cut's points instead.
void cut_tet(std::vector<SubCell>& cells, std::size_t axis) {
  SubCell tet = permuted(parse(templates()[kTet].cells[0]), kPermutations[axis]);
  CellPoint tip{};
  tip[axis] = kCell;
  for (SubCell& cell : cells) {
    const auto at = std::find(cell.begin(), cell.end(), tip);
    if (at == cell.end()) continue;
    cell.erase(at);
    for (const CellPoint& p : tet)
      if (p != tip) cell.push_back(p);
    std::sort(cell.begin(), cell.end());
  }
  cells.push_back(std::move(tet));
}

using Drawing = std::set<SubCell>;  // the polygons on a face

Drawing drawing_on_inner_face(const std::vector<SubCell>& cells, std::size_t axis) {
  Drawing drawing;
  for (const SubCell& cell : cells) {
    SubCell polygon;
    std::copy_if(cell.begin(), cell.end(), std::back_inserter(polygon), [&](const CellPoint& p) { return p[axis] == kCell; });
    if (polygon.size() >= 3) drawing.insert(std::move(polygon));
  }
  return drawing;
}

// The edges of a cell that touch no fine face: the edge along an axis lies in the two faces of the other axes.
std::uint8_t free_edges(std::uint8_t faces) {
  std::uint8_t edges = 0;
  for (unsigned axis = 0; axis < 3; ++axis)
    if ((faces & ~(1u << axis)) == 0) edges = static_cast<std::uint8_t>(edges | 1u << axis);
  return edges;
}

}  // namespace

std::vector<Placement> make_placements() {
  std::vector<Placement> placements;
  std::set<std::vector<SubCell>> seen;
  for (std::size_t kind = 0; kind < kTet; ++kind) {
    for (const Permutation& to : kPermutations) {
      const std::uint8_t faces = permuted(templates()[kind].faces, to);
      for (std::uint8_t edges = 0; edges < 8; ++edges) {
        if (edges & ~free_edges(faces)) continue;
        Placement placement{faces, edges, {}, {}};
        for (const std::string_view text : templates()[kind].cells) placement.cells.push_back(permuted(parse(text), to));
        for (std::size_t axis = 0; axis < 3; ++axis)
          if (edges >> axis & 1) cut_tet(placement.cells, axis);
        std::vector<SubCell> identity = placement.cells;
        std::sort(identity.begin(), identity.end());
        if (seen.insert(std::move(identity)).second) placements.push_back(std::move(placement));
      }
    }
  }
  std::stable_sort(placements.begin(), placements.end(),
                   [](const Placement& a, const Placement& b) { return a.cells.size() < b.cells.size(); });

  std::map<Drawing, int> number[3];
  for (Placement& placement : placements)
    for (std::size_t axis = 0; axis < 3; ++axis)
      placement.inner_face[axis] =
          number[axis].try_emplace(drawing_on_inner_face(placement.cells, axis), static_cast<int>(number[axis].size())).first->second;
  return placements;
}

}  // namespace strata
