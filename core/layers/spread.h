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

// Who bears how much of what must give way.
enum class Burden {
  Alike,    // each ring of hexes the same: right for moves of a few sizes, and quickly found
  BySize,  // large hexes more than small ones, in proportion to the square of their lengths: the small ones near what is driven go along
  // nearly unchanged, however far that is, as long as there are larger ones before them
};

class Spread {
 public:
  // Only vertices within `rings` rings of a driven one are carried. Sizes are those of the mesh as it is now.
  Spread(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, Burden burden = Burden::Alike);
  // What counts, when it is not everything.
  struct Among {
    IdMap<VertexId, std::uint8_t> vertices;  // 1: counts
    std::vector<std::pair<VertexId, VertexId>> apart;  // sorted: edges that do not carry, either way round
  };
  Spread(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, const Among& among);

  [[nodiscard]] const std::vector<VertexId>& carried() const { return carried_; }  // by ring, then by id
  // Fills in the moves of the carried vertices: the mean of their neighbours' (discrete harmonic), nothing beyond the last ring.
  void fill(IdMap<VertexId, Vec3>& move) const;

 private:
  void weigh(const HexMesh& mesh);
  void solve(IdMap<VertexId, Vec3>& move) const;
  void reach(const HexMesh& mesh, const VertexStars<HexId>& stars, const IdMap<VertexId, Role>& role, int rings, const Among* among);

  std::vector<VertexId> carried_;
  std::vector<std::size_t> ring_end_;
  std::vector<std::int32_t> first_;  // neighbours by edges of carried_[i]
  std::vector<VertexId> neighbours_;
  std::vector<double> weight_;  // of each of these; empty: all alike
  IdMap<VertexId, std::int32_t> slot_;  // in carried_, or -1; only with weights
};

}  // namespace strata
