// Carries the moves of some vertices into the volume, so that many rings of hexes share what the first would have to bear alone.
#pragma once

#include <cstdint>
#include <utility>
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
  // Only vertices within `rings` rings of a driven one are carried.
  Spread(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings);
  // What counts, when it is not everything.
  struct Among {
    IdMap<VertexId, std::uint8_t> vertices;                    // 1: counts
    std::vector<std::pair<VertexId, VertexId>> apart;          // sorted: edges that do not carry, either way round
  };
  Spread(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, const Among& among);

  [[nodiscard]] const std::vector<VertexId>& carried() const { return carried_; }  // by ring, then by id
  // Fills in the moves of the carried vertices: the mean of their neighbours' (discrete harmonic), nothing beyond the last ring.
  void fill(IdMap<VertexId, Vec3>& move) const;

 private:
  void reach(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, const Among* among);

  std::vector<VertexId> carried_;
  std::vector<std::size_t> ring_end_;
  std::vector<std::int32_t> first_;        // neighbours by edges of carried_[i]
  std::vector<VertexId> neighbours_;
};

}  // namespace strata
