// The way down when something does not work out: only bad input, limits and cancellation end a run without a mesh.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/base/diagnostic.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"
#include "core/quality/validity.h"

namespace strata {

class Context;

// Runs a part of the pipeline and returns what went wrong with it: a failure of ours, or an exception that nobody foresaw. Bad input, limits,
// want of memory and cancellation pass through.
std::optional<Diagnostic> failure_of(const std::function<void()>& part);

// Tells that a rung was lost: what the mesh is now, and the failure that led there.
void report_fall(const Diagnostic& failure, Reason reason, const std::string& what, Context& context);

// Throws MeshError(Internal) with the first promise that is broken.
void require(const HexMesh& mesh, const Promises& promises = {});
// The same of the mesh as it will be in the input's frame: far from the origin coordinates are coarse.
void require_in_input(const HexMesh& mesh, const Frame& frame);
// Throws MeshError(Internal) when the skin touches itself.
void require_no_contacts(const HexMesh& mesh);

// Vertices of a skin that touches itself are drawn in, and told: whoever reads such a mesh takes the place for a crack.
struct OffItself {
  HexMesh mesh;
  bool touched = false;  // it was drawn in somewhere
};
OffItself take_off_itself(HexMesh mesh, Context& context);

// Every quad takes the patch and the chart of the nearest place of the surface. The carved hexes alone are the rung `carved_dual`.
HexMesh label_by_nearest(HexMesh mesh, const Ground& ground);
// The rung `staircase`: the carved hexes with their buffer layer, as they are, labelled by nearest.
HexMesh make_staircase(HexMesh wrapped, const Ground& ground, Context& context);

// Hexes that are positive at the corners but, as far as can be proved, not everywhere inside: told, not refused.
void report_folded(const HexMesh& mesh, Context& context);

}  // namespace strata
