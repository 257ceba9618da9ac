// Carries the moves of some vertices into the volume, so that many rings of hexes share what the first would have to bear alone.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

enum class Role : std::uint8_t {
  Carried,  // goes along
  Driven,   // its move is given
  Still,    // does not move
};

class Spread {
 public:
  // Only vertices within `rings` rings of a driven one are carried. `on`, if given: the vertices that count at all (1).
  Spread(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings,
         const IdMap<VertexId, std::uint8_t>* on = nullptr);

  [[nodiscard]] const std::vector<VertexId>& carried() const { return carried_; }  // by ring, then by id
  // Fills in the moves of the carried vertices: the mean of their neighbours' (discrete harmonic), nothing beyond the last ring.
  void fill(IdMap<VertexId, Vec3>& move) const;

 private:
  std::vector<VertexId> carried_;
  std::vector<std::size_t> ring_end_;
  std::vector<std::int32_t> first_;        // neighbours by edges of carried_[i]
  std::vector<VertexId> neighbours_;
};

}  // namespace strata
