// Cutting the sheets into layers.
#pragma once

#include <vector>

#include "core/layers/columns.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

// A sheet and where its columns are to be cut.
struct Stack {
  Columns columns;
  int cells = 1;                        // layers the sheet becomes, blending included
  std::vector<double> level;            // cells per column: fractions of its length where its layers end; the last is 1
  std::vector<std::uint8_t> straight;   // by column: its points lie on the line between its ends, not on the ground; may be empty
  Prisms prisms;                        // hexes of this sheet that run out to nothing
};

// Cuts every stack: a hex that lies in sheets of n and m layers becomes n x m hexes. Points of a column that lies on the surface are put
// back on it. Prisms become wedge hexes: one for two layers, the middle point pushed into the next column (paper section 9); `cells` must be
// even there. HexMesh::layer counts from the wall, blending layers continue the count; in crossings the smaller number counts.
struct Sliced {
  HexMesh mesh;
  IdMap<HexId, HexId> parent;  // the hex each was cut from; invalid for wedge hexes
  IdMap<HexId, std::int32_t> prism;  // the prism each wedge hex was cut from, counted through all stacks; -1 for other hexes
};
Sliced slice(HexMesh mesh, std::vector<Stack> stacks, const Ground& ground);

}  // namespace strata
