// A sheet on its way from nothing to its thickness.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "core/layers/columns.h"
#include "core/layers/wall.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

struct GrowingSheet {
  Columns columns;
  Prisms prisms;                                       // hexes that run out to nothing; not in the mesh while the sheet grows
  std::vector<Foot> feet;                              // of the columns
  std::vector<std::array<std::int32_t, 2>> beside;     // columns joined by an edge of the wall
  std::vector<double> thickness;                       // wanted, normal to the wall
  std::vector<double> needed;  // of it for the physical layers and the least blending: the rest may not cost quality
  std::vector<double> physical;  // of that for the physical layers; infinite where nothing comes above them
  std::vector<double> first;  // of that for the first layer
};

// Where the first and the last physical layer of a column of the given length end, as shares of it.
struct CutShares {
  double first = 1, physical = 1;
};
inline CutShares shares_of(const GrowingSheet& sheet, std::size_t column, double length) {
  const double needed = sheet.needed[column] * sheet.feet[column].stretch;
  if (needed <= 0) return {};
  const double scale = sheet.feet[column].stretch / std::max(needed, length);
  return {std::min(sheet.first[column] * scale, 1.0), std::min(sheet.physical[column] * scale, 1.0)};
}

}  // namespace strata
