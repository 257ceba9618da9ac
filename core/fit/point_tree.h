// Nearest vertices to a place: an implicit k-d tree over some vertices of a mesh.
#pragma once

#include <utility>
#include <vector>

#include "core/mesh/hex_mesh.h"

namespace strata {

class PointTree {
 public:
  // Over the given vertices; positions are copied. O(n log n).
  PointTree(const HexMesh& mesh, const std::vector<VertexId>& vertices);
  // The vertices within `radius` of p, nearest first (ties by id).
  [[nodiscard]] std::vector<VertexId> within(const Vec3& p, double radius) const;

  // The nearest vertex (ties by id); invalid for an empty tree.
  [[nodiscard]] VertexId nearest(const Vec3& p) const;

 private:
  struct Entry {
    Vec3 position;
    VertexId vertex;
  };
  void build(std::size_t begin, std::size_t end, int axis);
  template <class Visit>
  void visit(std::size_t begin, std::size_t end, int axis, const Vec3& p, double radius, const Visit& found) const;
  void visit_nearest(std::size_t begin, std::size_t end, int axis, const Vec3& p, std::pair<double, VertexId>& best) const;
  std::vector<Entry> entries_;
};

}  // namespace strata
