// Making room: the tops of columns leave the wall and push the volume before them, never through a hex.
#pragma once

#include <vector>

#include "core/layers/columns.h"
#include "core/layers/wall.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

// A sheet on its way from nothing to its thickness.
struct GrowingSheet {
  Columns columns;
  std::vector<Foot> feet;          // of the columns
  std::vector<double> thickness;   // wanted, normal to the wall
  std::vector<double> needed;      // of it for the physical layers: what is beyond may not cost quality
};

// Lifts the tops of the given sheet off their bottoms by a small part of the local size, all at once: hexes of no thickness become thin.
HexMesh open_sheet(HexMesh mesh, const GrowingSheet& sheet, const Ground& ground);

// Lets everything round the active sheets find its place, walls on their charts and tops too, with the thickness as a wish only: a good
// start for thick sheets and crossings.
HexMesh relax(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const std::vector<std::uint8_t>& active, const Ground& ground,
              Context& context);

// Moves the tops of the active sheets to their thickness, in steps that keep every hex positive, and lets the rest of the mesh give way
// between: walls of other sheets slide on their charts, inner sheets keep their shape. Bottoms of active sheets do not move.
HexMesh inflate(HexMesh mesh, const std::vector<GrowingSheet>& sheets, const std::vector<std::uint8_t>& active, const Ground& ground,
                int rounds, Context& context);

// Height of a column normal to the wall, as it is.
double height_of(const HexMesh& mesh, const GrowingSheet& sheet, std::size_t column);

}  // namespace strata
