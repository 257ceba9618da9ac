#include "core/mesh/part.h"

#include <algorithm>

#include "core/mesh/adjacency.h"

namespace strata {

IdMap<VertexId, std::uint8_t> vertices_of(const HexMesh& mesh, const std::vector<HexId>& hexes) {
  IdMap<VertexId, std::uint8_t> marked(mesh.position.size(), 0);
  for (HexId h : hexes)
    for (VertexId v : mesh.hexes[h]) marked[v] = 1;
  return marked;
}

MeshPart cut_part(const HexMesh& whole, const IdMap<VertexId, std::uint8_t>& marked, int rings) {
  // Few hexes of many: a pass over all of them a ring is cheaper than stars of all vertices.
  IdMap<VertexId, std::uint8_t> reached = marked;
  std::vector<std::uint8_t> near(whole.hexes.size(), 0);
  for (int ring = 0; ring < rings; ++ring) {
    std::vector<HexId> added;
    for (HexId h : whole.hexes.ids()) {
      if (near[h.index()] != 0) continue;
      const HexVertices& hex = whole.hexes[h];
      if (std::any_of(hex.begin(), hex.end(), [&](VertexId v) { return reached[v] != 0; })) added.push_back(h);
    }
    for (HexId h : added) {
      near[h.index()] = 1;
      for (VertexId v : whole.hexes[h]) reached[v] = 1;
    }
  }
  MeshPart part;
  IdMap<VertexId, std::uint8_t> inside(whole.position.size(), 0);
  for (HexId h : whole.hexes.ids())
    if (near[h.index()] != 0)
      for (VertexId v : whole.hexes[h]) inside[v] = 1;
  IdMap<VertexId, VertexId> here(whole.position.size());
  for (VertexId v : whole.position.ids()) {
    if (inside[v] == 0) continue;
    here[v] = part.mesh.position.push_back(whole.position[v]);
    part.mesh.attachment.push_back(whole.attachment[v]);
    part.whole.push_back(v);
  }
  for (HexId h : whole.hexes.ids()) {
    HexVertices hex = whole.hexes[h];
    if (near[h.index()] == 0) {
      for (VertexId v : hex)
        if (here[v].valid()) part.mesh.attachment[here[v]] = {Hold::Fixed, -1};
      continue;
    }
    for (VertexId& v : hex) v = here[v];
    part.mesh.hexes.push_back(hex);
    part.mesh.region.push_back(whole.region[h]);
    part.mesh.layer.push_back(whole.layer[h]);
  }
  for (QuadId q : whole.quads.ids()) {
    QuadVertices quad = whole.quads[q];
    // A quad with a vertex that is not fixed has all its hexes in the part.
    bool all = true, loose = false;
    for (VertexId v : quad) {
      all = all && here[v].valid();
      loose = loose || (here[v].valid() && part.mesh.attachment[here[v]].hold != Hold::Fixed);
    }
    if (!all || !loose) continue;
    for (VertexId& v : quad) v = here[v];
    part.mesh.quads.push_back(quad);
    part.mesh.patch.push_back(whole.patch[q]);
    part.mesh.chart.push_back(whole.chart[q]);
  }
  return part;
}

void put_back(const MeshPart& part, HexMesh& whole) {
  for (VertexId v : part.mesh.position.ids()) {
    if (part.mesh.attachment[v].hold == Hold::Fixed) continue;
    whole.position[part.whole[v]] = part.mesh.position[v];
    whole.attachment[part.whole[v]] = part.mesh.attachment[v];
  }
}

}  // namespace strata
