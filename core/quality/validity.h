// Is a mesh what a mesh promises to be: the last gate before it leaves the mesher.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/base/diagnostic.h"
#include "core/base/vec3.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// What counts as zero for a scaled Jacobian, at a corner or the centre: rounding makes as much of it, and the next rounding may turn it.
inline constexpr double kZeroProduct = 1e-8;

// Whether the Jacobian determinant of the trilinear map is positive on the whole hex, not only at corners and centre. True is a proof;
// false is a counterexample or, rarely, a minimum so close to 0 that eight-fold bisection does not decide. Up to about 1 microsecond for
// ordinary hexes.
bool bernstein_positive(const std::array<Vec3, 8>& corners);

// Hexes that bernstein_positive does not vouch for, ascending.
std::vector<HexId> folded_hexes(const HexMesh& mesh);

// What a mesh need not keep yet half-way down the pipeline.
struct Promises {
  int quads_per_hex = 1;  // of the volume; layers that cross have up to three
  bool labelled = true;   // every quad has a patch
  bool positive = true;   // every hex is
};

// The first promise the mesh breaks, with its place; empty when it keeps them all:
// arrays of one size, ids in range, finite coordinates; every face with one or two hexes, seen with opposite turns; quads exactly the
// boundary and interface faces, oriented as HexMesh asks, each with a patch; hexes of the volume with at most one quad; two quads at every
// edge of a region's boundary; every hex positive, by more than rounding, at its corners and its centre. Same answer for any thread count. About a third of a
// second for a million hexes.
std::optional<Diagnostic> check_mesh(const HexMesh& mesh, const Promises& promises = {});

}  // namespace strata
