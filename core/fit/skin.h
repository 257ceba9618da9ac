// The boundary and interface quads of a hex mesh as a graph: what feature matching walks on.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh/hex_mesh.h"

namespace strata {

// An edge between quads. Manifold skins have two quads an edge; where interfaces meet the skin there are more.
struct SkinEdge {
  VertexId a, b;            // a < b
  std::int32_t first = 0;   // quads round the edge: quads[first .. first + count)
  std::int32_t count = 0;
};

// Edges and adjacency of the quads; vertices keep their mesh ids. Built in one sort, dropped after matching.
class Skin {
 public:
  explicit Skin(const HexMesh& mesh);

  [[nodiscard]] const std::vector<VertexId>& vertices() const { return vertices_; }  // ascending
  [[nodiscard]] const std::vector<SkinEdge>& edges() const { return edges_; }
  [[nodiscard]] std::span<const QuadId> quads_of(const SkinEdge& e) const {
    return {edge_quads_.data() + e.first, static_cast<std::size_t>(e.count)};
  }
  // Indices of the edges round a vertex, ascending; empty for a vertex inside the volume.
  [[nodiscard]] std::span<const std::int32_t> edges_round(VertexId v) const {
    return {vertex_edges_.data() + vertex_offset_[v.index()], vertex_edges_.data() + vertex_offset_[v.index() + 1]};
  }
  [[nodiscard]] VertexId other_end(std::int32_t edge, VertexId v) const {
    const SkinEdge& e = edges_[static_cast<std::size_t>(edge)];
    return e.a == v ? e.b : e.a;
  }
  // Index of the edge between two vertices, or -1.
  [[nodiscard]] std::int32_t edge_between(VertexId u, VertexId v) const;
  // Mean length of the edges round the vertex.
  [[nodiscard]] double size_at(const HexMesh& mesh, VertexId v) const;

 private:
  std::vector<VertexId> vertices_;
  std::vector<SkinEdge> edges_;
  std::vector<QuadId> edge_quads_;
  std::vector<std::int32_t> vertex_edges_;
  std::vector<std::int64_t> vertex_offset_;
};

}  // namespace strata
