#include "core/layers/band.h"

#include <algorithm>

#include "core/mesh/adjacency.h"

namespace strata {
namespace {

// Hexes within `rings` rings: ring by ring, the hexes that touch a vertex reached so far.
IdMap<HexId, std::uint8_t> hexes_near(const HexMesh& mesh, IdMap<VertexId, std::uint8_t> reached, int rings) {
  const VertexStars<HexId> stars = hexes_round_vertices(mesh);
  IdMap<HexId, std::uint8_t> near(mesh.hexes.size(), 0);
  std::vector<VertexId> front;
  for (VertexId v : reached.ids())
    if (reached[v]) front.push_back(v);
  for (int ring = 0; ring < rings && !front.empty(); ++ring) {
    std::vector<VertexId> next;
    for (VertexId v : front)
      for (HexId h : stars.of(v)) {
        if (near[h]) continue;
        near[h] = 1;
        for (VertexId w : mesh.hexes[h])
          if (!reached[w]) reached[w] = 1, next.push_back(w);
      }
    front = std::move(next);
  }
  return near;
}

void append_hex(HexMesh& to, const HexVertices& hex, RegionId region, std::uint16_t layer) {
  to.hexes.push_back(hex);
  to.region.push_back(region);
  to.layer.push_back(layer);
}

void append_quad(HexMesh& to, const QuadVertices& quad, PatchId patch, ChartId chart) {
  to.quads.push_back(quad);
  to.patch.push_back(patch);
  to.chart.push_back(chart);
}

}  // namespace

Band cut_band(HexMesh whole, const IdMap<VertexId, std::uint8_t>& wall, int rings) {
  const IdMap<HexId, std::uint8_t> near = hexes_near(whole, wall, rings);
  IdMap<VertexId, std::uint8_t> inside(whole.position.size(), 0), outside(whole.position.size(), 0);
  for (HexId h : whole.hexes.ids())
    for (VertexId v : whole.hexes[h]) (near[h] ? inside : outside)[v] = 1;
  Band band;
  IdMap<VertexId, VertexId> in_band(whole.position.size());
  for (VertexId v : whole.position.ids()) {
    if (!inside[v]) continue;
    in_band[v] = band.mesh.position.push_back(whole.position[v]);
    band.whole_vertex.push_back(v);
    band.attachment.push_back(whole.attachment[v]);
    band.mesh.attachment.push_back(outside[v] ? Attachment{Hold::Fixed, -1} : whole.attachment[v]);
  }
  for (HexId h : whole.hexes.ids()) {
    HexVertices hex = whole.hexes[h];
    if (near[h])
      for (VertexId& v : hex) v = in_band[v];
    append_hex(near[h] ? band.mesh : band.rest, hex, whole.region[h], whole.layer[h]);
  }
  const IdMap<QuadId, QuadSides> sides = quad_sides(whole);
  for (QuadId q : whole.quads.ids()) {
    // An interface quad between a hex of the band and another stays with the rest.
    const QuadSides& s = sides[q];
    const bool here = s.back.valid() && near[s.back] && (!s.front.valid() || near[s.front]);
    QuadVertices quad = whole.quads[q];
    if (here)
      for (VertexId& v : quad) v = in_band[v];
    append_quad(here ? band.mesh : band.rest, quad, whole.patch[q], whole.chart[q]);
  }
  band.rest.position = std::move(whole.position);
  band.rest.attachment = std::move(whole.attachment);
  return band;
}

HexMesh join_band(Band band, IdMap<VertexId, VertexId>& vertex_in_whole) {
  HexMesh& part = band.mesh;
  HexMesh whole = std::move(band.rest);
  vertex_in_whole = std::move(band.whole_vertex);
  const std::size_t known = vertex_in_whole.size();
  vertex_in_whole.resize(part.position.size());
  for (VertexId v : part.position.ids()) {
    if (v.index() < known) {
      const VertexId w = vertex_in_whole[v];
      whole.position[w] = part.position[v];
      whole.attachment[w] = part.attachment[v].hold == Hold::Fixed ? band.attachment[v] : part.attachment[v];
    } else {
      vertex_in_whole[v] = whole.position.push_back(part.position[v]);
      whole.attachment.push_back(part.attachment[v]);
    }
  }
  for (HexId h : part.hexes.ids()) {
    HexVertices hex = part.hexes[h];
    for (VertexId& v : hex) v = vertex_in_whole[v];
    append_hex(whole, hex, part.region[h], part.layer[h]);
  }
  for (QuadId q : part.quads.ids()) {
    QuadVertices quad = part.quads[q];
    for (VertexId& v : quad) v = vertex_in_whole[v];
    append_quad(whole, quad, part.patch[q], part.chart[q]);
  }
  return whole;
}

}  // namespace strata
