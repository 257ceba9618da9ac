#include "core/fit/skin.h"

#include <algorithm>
#include <tuple>

#include "core/base/parallel.h"

namespace strata {

Skin::Skin(const HexMesh& mesh) {
  struct Side {
    VertexId a, b;
    QuadId quad;
  };
  std::vector<Side> sides(mesh.quads.size() * 4);
  parallel_for(mesh.quads.size(), [&](std::size_t i) {
    const QuadVertices& q = mesh.quads[QuadId(i)];
    for (std::size_t k = 0; k < 4; ++k) {
      const VertexId u = q[k], v = q[(k + 1) & 3];
      sides[4 * i + k] = {std::min(u, v), std::max(u, v), QuadId(i)};
    }
  });
  parallel_sort(sides.begin(), sides.end(),
                [](const Side& x, const Side& y) { return std::tie(x.a, x.b, x.quad) < std::tie(y.a, y.b, y.quad); });
  edge_quads_.resize(sides.size());
  for (std::size_t i = 0; i < sides.size(); ++i) {
    edge_quads_[i] = sides[i].quad;
    if (i == 0 || sides[i].a != sides[i - 1].a || sides[i].b != sides[i - 1].b)
      edges_.push_back({sides[i].a, sides[i].b, static_cast<std::int32_t>(i), 0});
    ++edges_.back().count;
  }

  vertex_offset_.assign(mesh.position.size() + 1, 0);
  for (const SkinEdge& e : edges_) {
    ++vertex_offset_[e.a.index() + 1];
    ++vertex_offset_[e.b.index() + 1];
  }
  for (std::size_t v = 0; v < mesh.position.size(); ++v) {
    if (vertex_offset_[v + 1] > 0) vertices_.push_back(VertexId(v));
    vertex_offset_[v + 1] += vertex_offset_[v];
  }
  vertex_edges_.resize(edges_.size() * 2);
  std::vector<std::int64_t> next(vertex_offset_.begin(), vertex_offset_.end() - 1);
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    vertex_edges_[static_cast<std::size_t>(next[edges_[e].a.index()]++)] = static_cast<std::int32_t>(e);
    vertex_edges_[static_cast<std::size_t>(next[edges_[e].b.index()]++)] = static_cast<std::int32_t>(e);
  }
}

std::int32_t Skin::edge_between(VertexId u, VertexId v) const {
  for (std::int32_t e : edges_round(u))
    if (other_end(e, u) == v) return e;
  return -1;
}

double Skin::size_at(const HexMesh& mesh, VertexId v) const {
  double sum = 0;
  const auto edges = edges_round(v);
  for (std::int32_t e : edges) sum += (mesh.position[other_end(e, v)] - mesh.position[v]).norm();
  return edges.empty() ? 0 : sum / static_cast<double>(edges.size());
}

}  // namespace strata
