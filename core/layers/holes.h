// Places of a wall that no layers fit on are left out of it, a few quads each, and the layers run out round them in wedges.
#pragma once

#include <optional>
#include <vector>

#include "core/base/vec3.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

// The quads of the wall (1 in `wall`, by quad) that lie nearest to each of the places, with those round them; added to `holes` (sorted). Where
// a hole is known already, it grows. Nothing: this would take more than a small part of the wall.
std::optional<std::vector<QuadId>> widened_holes(const HexMesh& mesh, const IdMap<QuadId, std::uint8_t>& wall, std::vector<QuadId> holes,
                                                 const std::vector<Vec3>& places);

// The mesh with a fresh row of quads round each hole, on which wedges can end; quads keep their ids. Where a row does not fit, holes grow
// first. Nothing: it does not fit anywhere.
struct WithHoles {
  HexMesh mesh;
  std::vector<QuadId> holes;
};
std::optional<WithHoles> with_rows_round(const HexMesh& mesh, const IdMap<QuadId, std::uint8_t>& wall, std::vector<QuadId> holes,
                                         const Ground& ground, Context& context);

}  // namespace strata
