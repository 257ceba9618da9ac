// The cell templates of the transition scheme, as published, and all their placements in a cell.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace strata {

// Coordinates inside a cell in twentieths of its edge, seen from the block's outer corner: 0 is on the block's boundary, 20 on the
// block's mid plane.
inline constexpr int kCell = 20;
using CellPoint = std::array<std::int8_t, 3>;
using SubCell = std::vector<CellPoint>;

// One template put into a cell.
struct Placement {
  std::uint8_t faces = 0;              // bit a: the outer face along axis a is fine
  std::uint8_t edges = 0;              // bit a: the block's edge along axis a carries a cut of its own (no fine face touches it)
  std::vector<SubCell> cells;
  std::array<int, 3> inner_face{};     // what is drawn on the inner face along each axis; equal numbers: equal drawings
};

// All placements, the ones with fewest sub-cells first. Deterministic.
std::vector<Placement> make_placements();

}  // namespace strata
