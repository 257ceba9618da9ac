#include "core/optimise/colouring.h"

namespace strata {

std::vector<std::vector<VertexId>> colour_vertices(const HexMesh& mesh, const VertexStars<HexId>& star,
                                                   const IdMap<VertexId, std::uint8_t>& chosen) {
  std::vector<std::vector<VertexId>> colours;
  IdMap<VertexId, std::int16_t> colour(mesh.position.size(), std::int16_t{-1});
  std::vector<VertexId> taken_by;  // per colour: the vertex that last saw it taken
  for (const VertexId v : mesh.position.ids()) {
    if (chosen[v] == 0) continue;
    for (const HexId h : star.of(v))
      for (const VertexId n : mesh.hexes[h])
        if (colour[n] >= 0) taken_by[static_cast<std::size_t>(colour[n])] = v;
    std::size_t c = 0;
    while (c < colours.size() && taken_by[c] == v) ++c;
    if (c == colours.size()) {
      colours.emplace_back();
      taken_by.emplace_back();
    }
    colour[v] = static_cast<std::int16_t>(c);
    colours[c].push_back(v);
  }
  return colours;
}

}  // namespace strata
