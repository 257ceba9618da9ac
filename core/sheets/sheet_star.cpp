#include "core/sheets/sheet_star.h"

#include <algorithm>

#include "core/base/parallel.h"

namespace strata {
namespace {

bool contains(const HexVertices& hex, const QuadVertices& q) {
  for (VertexId v : q)
    if (std::find(hex.begin(), hex.end(), v) == hex.end()) return false;
  return true;
}

// Ids of the elements that have a marked vertex, ascending: count per block, scan, fill.
template <class Element, class Map>
std::vector<Element> touching(const Map& rows, const IdMap<VertexId, std::int32_t>& local) {
  const auto touches = [&](std::size_t i) {
    for (VertexId v : rows[Element(i)])
      if (local[v] >= 0) return true;
    return false;
  };
  constexpr std::size_t kBlock = 16384;
  std::vector<std::vector<Element>> found((rows.size() + kBlock - 1) / kBlock);
  parallel_blocks(
      rows.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i != end; ++i)
          if (touches(i)) found[begin / kBlock].push_back(Element(i));
      },
      kBlock);
  std::vector<Element> all;
  for (const auto& part : found) all.insert(all.end(), part.begin(), part.end());
  return all;
}

}  // namespace

SortedFace sorted_face(const QuadVertices& q) {
  SortedFace s{q[0].value, q[1].value, q[2].value, q[3].value};
  std::sort(s.begin(), s.end());
  return s;
}

template <class Element, class VerticesOf>
SheetStar::Rows<Element> SheetStar::make_rows(const std::vector<Element>& elements, const VerticesOf& vertices_of) const {
  Rows<Element> rows;
  rows.offset.assign(vertices_.size() + 1, 0);
  for (const Element& e : elements)
    for (VertexId v : vertices_of(e))
      if (local_[v] >= 0) ++rows.offset[static_cast<std::size_t>(local_[v])];
  exclusive_scan(rows.offset);
  rows.elements.resize(static_cast<std::size_t>(rows.offset.back()));
  std::vector<std::int32_t> next = rows.offset;
  for (const Element& e : elements)
    for (VertexId v : vertices_of(e))
      if (local_[v] >= 0) rows.elements[static_cast<std::size_t>(next[static_cast<std::size_t>(local_[v])]++)] = e;
  return rows;
}

SheetStar::SheetStar(const HexMesh& mesh, const SheetRequest& request)
    : mesh_(&mesh), request_(&request), local_(mesh.position.size(), -1), open_(mesh.hexes.size(), std::uint8_t{0}) {
  std::vector<std::int32_t> face_ids(request.faces.size());
  for (std::size_t i = 0; i < request.faces.size(); ++i) {
    const HexFace& f = request.faces[i];
    face_ids[i] = static_cast<std::int32_t>(i);
    open_[f.hex] = static_cast<std::uint8_t>(open_[f.hex] | (1U << f.face));
    for (VertexId v : face_vertices(mesh.hexes[f.hex], f.face)) {
      if (local_[v] >= 0) continue;
      local_[v] = 0;
      vertices_.push_back(v);
    }
  }
  std::sort(vertices_.begin(), vertices_.end());
  for (std::size_t i = 0; i < vertices_.size(); ++i) local_[vertices_[i]] = static_cast<std::int32_t>(i);
  hexes_ = touching<HexId>(mesh.hexes, local_);
  quads_ = touching<QuadId>(mesh.quads, local_);
  hex_rows_ = make_rows(hexes_, [&](HexId h) -> const HexVertices& { return mesh.hexes[h]; });
  quad_rows_ = make_rows(quads_, [&](QuadId q) -> const QuadVertices& { return mesh.quads[q]; });
  face_rows_ = make_rows(face_ids, [&](std::int32_t i) { return face(i); });
}

QuadVertices SheetStar::face(std::int32_t i) const {
  const HexFace& f = request_->faces[static_cast<std::size_t>(i)];
  return face_vertices(mesh_->hexes[f.hex], f.face);
}

VertexId SheetStar::anchor(const QuadVertices& q) const {
  for (VertexId v : q)
    if (local_[v] >= 0) return v;
  return {};
}

FaceNeighbour SheetStar::across(HexId h, int face) const {
  const QuadVertices q = face_vertices(mesh_->hexes[h], face);
  const SortedFace key = sorted_face(q);
  for (HexId other : hexes_of(anchor(q))) {
    if (other == h || !contains(mesh_->hexes[other], q)) continue;
    for (int f = 0; f < 6; ++f)
      if (sorted_face(face_vertices(mesh_->hexes[other], f)) == key) return {other, static_cast<std::int8_t>(f)};
  }
  return {};
}

QuadId SheetStar::quad_on(HexId h, int face) const {
  const QuadVertices q = face_vertices(mesh_->hexes[h], face);
  const SortedFace key = sorted_face(q);
  for (QuadId quad : quads_of(anchor(q)))
    if (sorted_face(mesh_->quads[quad]) == key) return quad;
  return {};
}

std::optional<std::int32_t> SheetStar::other_face_at(std::int32_t i, VertexId a, VertexId b) const {
  for (std::int32_t j : faces_of(a)) {
    if (j == i) continue;
    const QuadVertices q = face(j);
    if (std::find(q.begin(), q.end(), b) != q.end()) return j;
  }
  return std::nullopt;
}

QuadId SheetStar::walk_to_boundary(HexId h, int from, VertexId a, VertexId b) const {
  // An edge has few hexes round it; the bound only guards against a broken mesh.
  for (std::size_t step = 0; step <= hexes_of(a).size(); ++step) {
    int next = -1;
    for (int f = 0; f < 6; ++f) {
      if (f == from) continue;
      const QuadVertices q = face_vertices(mesh_->hexes[h], f);
      if (std::find(q.begin(), q.end(), a) != q.end() && std::find(q.begin(), q.end(), b) != q.end()) next = f;
    }
    const FaceNeighbour beyond = across(h, next);
    if (!beyond.hex.valid()) return quad_on(h, next);
    h = beyond.hex;
    from = beyond.face;
  }
  return {};
}

}  // namespace strata
