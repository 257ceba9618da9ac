// Is a mesh what a mesh promises to be: the last gate before it leaves the mesher.
#pragma once

#include <array>
#include <optional>

#include "core/base/diagnostic.h"
#include "core/base/vec3.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// Whether the Jacobian determinant of the trilinear map is positive on the whole hex, not only at corners and centre. True is a proof;
// false is a counterexample or, rarely, a minimum so close to 0 that eight-fold bisection does not decide. Up to about 1 microsecond for
// ordinary hexes.
bool bernstein_positive(const std::array<Vec3, 8>& corners);

// The first promise the mesh breaks, with its place; empty when it keeps them all:
// arrays of one size, ids in range, finite coordinates; every face with one or two hexes, seen with opposite turns; quads exactly the
// boundary and interface faces, oriented as HexMesh asks, each with a patch; hexes of the volume with at most one quad; two quads at every
// edge of a region's boundary; every hex positive at its corners and its centre. Same answer for any thread count.
std::optional<Diagnostic> check_mesh(const HexMesh& mesh);

}  // namespace strata
