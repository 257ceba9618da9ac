// The neighbourhood of a sheet: what touches its vertices, indexed locally so that the work is proportional to the sheet.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/mesh/adjacency.h"
#include "core/sheets/insert_sheet.h"

namespace strata {

// Where sheet faces meet mesh edges and quads. Valid as long as the mesh and the request it was made from.
class SheetStar {
 public:
  SheetStar(const HexMesh& mesh, const SheetRequest& request);

  [[nodiscard]] const std::vector<VertexId>& vertices() const { return vertices_; }  // of the faces, ascending
  [[nodiscard]] const std::vector<HexId>& hexes() const { return hexes_; }           // touching a vertex, ascending
  [[nodiscard]] const std::vector<QuadId>& quads() const { return quads_; }
  [[nodiscard]] std::int32_t local(VertexId v) const { return local_[v]; }           // -1: not on the sheet

  [[nodiscard]] std::span<const HexId> hexes_of(VertexId v) const { return row(hex_rows_, v); }
  [[nodiscard]] std::span<const QuadId> quads_of(VertexId v) const { return row(quad_rows_, v); }
  [[nodiscard]] std::span<const std::int32_t> faces_of(VertexId v) const { return row(face_rows_, v); }

  [[nodiscard]] bool is_open(HexId h, int face) const { return (open_[h] >> face & 1) != 0; }
  [[nodiscard]] bool is_inner(HexId h) const { return request_->inner[h] != 0; }
  [[nodiscard]] QuadVertices face(std::int32_t i) const;

  // The hex across a face that has at least one vertex on the sheet.
  [[nodiscard]] FaceNeighbour across(HexId h, int face) const;
  // The quad on a hex's face that has at least one vertex on the sheet.
  [[nodiscard]] QuadId quad_on(HexId h, int face) const;
  // The other sheet face at the edge (a, b) of sheet face i, if any.
  [[nodiscard]] std::optional<std::int32_t> other_face_at(std::int32_t i, VertexId a, VertexId b) const;
  // The boundary quad met when walking round the edge (a, b) from face `from` of hex h, through h.
  [[nodiscard]] QuadId walk_to_boundary(HexId h, int from, VertexId a, VertexId b) const;

 private:
  template <class Element>
  struct Rows {
    std::vector<std::int32_t> offset;
    std::vector<Element> elements;
  };
  template <class Element>
  [[nodiscard]] std::span<const Element> row(const Rows<Element>& rows, VertexId v) const {
    const auto i = static_cast<std::size_t>(local_[v]);
    return {rows.elements.data() + rows.offset[i], rows.elements.data() + rows.offset[i + 1]};
  }
  template <class Element, class VerticesOf>
  Rows<Element> make_rows(const std::vector<Element>& elements, const VerticesOf& vertices_of) const;
  // A vertex of the face that lies on the sheet.
  [[nodiscard]] VertexId anchor(const QuadVertices& q) const;

  const HexMesh* mesh_;
  const SheetRequest* request_;
  IdMap<VertexId, std::int32_t> local_;
  IdMap<HexId, std::uint8_t> open_;  // one bit per face that is in the request
  std::vector<VertexId> vertices_;
  std::vector<HexId> hexes_;
  std::vector<QuadId> quads_;
  Rows<HexId> hex_rows_;
  Rows<QuadId> quad_rows_;
  Rows<std::int32_t> face_rows_;
};

using SortedFace = std::array<std::int32_t, 4>;
SortedFace sorted_face(const QuadVertices& q);

}  // namespace strata
