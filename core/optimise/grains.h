// Who may move at the same time. Vertices that lie near one another form grains; grains of one colour share no hex, so their vertices are
// moved side by side, those of one grain one after another. Grains keep a sweep's data in the cache, and inside them news travels far in
// one sweep (dossier 6.5; LPlib's coloured grains are the model).
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/hex_mesh.h"

namespace strata {

struct Grains {
  std::vector<VertexId> order;                      // grain after grain, along a space-filling curve
  std::vector<std::uint32_t> first;                 // of each grain in `order`; one more at the end
  std::vector<std::vector<std::uint32_t>> colours;  // grains of each colour, ascending
};

// Of the vertices chosen (1). Depends on mesh and choice only, not on threads.
Grains make_grains(const HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& chosen);

}  // namespace strata
