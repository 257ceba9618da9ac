// Columns: the edges that cross a sheet, from the wall (bottom) to the inside (top). Slicing a sheet means cutting its columns.
#pragma once

#include <vector>

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

struct Columns {
  std::vector<VertexId> bottom;   // ascending, no repeats
  std::vector<VertexId> top;      // of each
  [[nodiscard]] std::size_t size() const { return bottom.size(); }
  // Index of the column that stands on v, or -1.
  [[nodiscard]] std::int32_t find(VertexId v) const;
};

// All columns of the sheet whose first hexes were `first` .. `first + count - 1` (column edges 0-4, 1-5, 2-6, 3-7), as they are after
// later sheets: these may have copied columns into hexes of their own, which come after.
Columns columns_of_sheet(const HexMesh& mesh, HexId first, std::size_t count);

// Columns of a sheet that are to run out to nothing: those on `bottoms` (sorted).
struct Vanishing {
  const Columns* columns;
  const std::vector<VertexId>* bottoms;
};
// Merges the tops of vanishing columns into their bottoms. Quads and hexes that lose an edge are taken out of the mesh; the hexes are kept
// as prisms, by the sheet they belong to: corners as in the mesh, two of the corners 4-7 equal to those under them.
struct Prisms {
  std::vector<HexVertices> hexes;
  std::vector<RegionId> region;
};
// Of the corners 0-3 the one where a prism's edge without height begins: it runs to the next.
std::size_t tip_of(const HexVertices& prism);
struct Collapsed {
  HexMesh mesh;
  std::vector<Prisms> prisms;   // of each sheet
};
Collapsed collapse_columns(HexMesh mesh, const std::vector<Vanishing>& sheets);

// New attachments for the inner copies of a sheet's vertices, from the quads that are round them now: inside, on a chart, or on a curve.
// Where several curves are left to choose from, the one that leaves along `direction` (per copied vertex) is taken.
void attach_copies(HexMesh& mesh, const IdMap<VertexId, VertexId>& inner_copy, const IdMap<VertexId, Vec3>& direction,
                   const Ground& ground);

}  // namespace strata
