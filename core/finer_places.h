// Where a mesh fell short of its surface, and the sizes that may help there: finer cells show what coarser ones had to give up.
#pragma once

#include <vector>

#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"
#include "core/sizing/size_field.h"

namespace strata {

// What a fit gave up. Working frame.
struct Shortfall {
  std::vector<Vec3> places;     // hexes that cost vertices their features or the surface
  int rounds = 0;               // of letting creases go that it took
};

struct FinerPlaces {
  std::vector<SizedSegment> segments;  // along curves
  std::vector<SizeSource> balls;       // round hexes
  [[nodiscard]] bool empty() const { return segments.empty() && balls.empty(); }
};

// Sharp curves, and long ones between two charts: what a mesh ought to show. Others may be noise of the triangulation. By curve, 1: counts.
IdMap<CurveId, std::uint8_t> curves_that_count(const HexMesh& mesh, const Ground& ground);

// How far a mesh is from what was asked of it.
struct Merit {
  double missed = 0;  // share of the surface's area that is farther than a cell from the mesh
  double lost = 0;  // share of the length of the curves that count, on which no edges stand
  double worst = 0;  // scaled Jacobian, as far as it counts
  [[nodiscard]] bool misses_thin_places() const;
  [[nodiscard]] bool will_do() const;  // as far as finer cells might help
};
Merit merit_of(const HexMesh& mesh, const Ground& ground, const IdMap<CurveId, std::uint8_t>& counts);
// Clearly, and in nothing clearly worse.
bool is_better(const Merit& merit, const Merit& than);

// Cells half as large where curves that count are not shown, round hexes that cost something and round those that are poor. Empty where
// nothing falls short, or so much that cells would be finer nearly everywhere: then the sizes asked for are too large as a whole.
FinerPlaces finer_places(const HexMesh& mesh, const Shortfall& shortfall, const Ground& ground, const IdMap<CurveId, std::uint8_t>& counts);

}  // namespace strata
