#include "core/mesh/adjacency.h"

#include <algorithm>

#include "core/base/diagnostic.h"
#include "core/base/parallel.h"

namespace strata {
namespace {

// The rows of vertices that are not wanted stay empty.
template <class Element, class Rows, class Wanted>
VertexStars<Element> stars(std::size_t vertex_count, const Rows& rows, const Wanted& wanted) {
  VertexStars<Element> result;
  result.offset.assign(vertex_count + 1, 0);
  for (const auto& row : rows)
    for (VertexId v : row)
      if (wanted(v)) ++result.offset[v.index() + 1];
  for (std::size_t v = 0; v < vertex_count; ++v) result.offset[v + 1] += result.offset[v];
  result.elements.resize(static_cast<std::size_t>(result.offset.back()));
  std::vector<std::int64_t> next(result.offset.begin(), result.offset.end() - 1);
  for (Element e : rows.ids())
    for (VertexId v : rows[e])
      if (wanted(v)) result.elements[static_cast<std::size_t>(next[v.index()]++)] = e;
  return result;
}
constexpr auto kAll = [](VertexId) { return true; };

[[noreturn]] void throw_broken(const char* what) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.message = what;
  throw MeshError(Failure::Internal, std::move(diagnostic));
}

using SortedQuad = std::array<std::int32_t, 4>;
SortedQuad sorted(const QuadVertices& q) {
  SortedQuad s{q[0].value, q[1].value, q[2].value, q[3].value};
  std::sort(s.begin(), s.end());
  return s;
}

bool same_turn(const QuadVertices& a, const QuadVertices& b) {
  for (int i = 0; i < 4; ++i)
    if (a[0] == b[static_cast<std::size_t>(i)]) return a[1] == b[static_cast<std::size_t>((i + 1) & 3)];
  return false;
}

}  // namespace

VertexStars<HexId> hexes_round_vertices(const HexMesh& mesh) { return stars<HexId>(mesh.position.size(), mesh.hexes, kAll); }
VertexStars<QuadId> quads_round_vertices(const HexMesh& mesh) { return stars<QuadId>(mesh.position.size(), mesh.quads, kAll); }

FaceNeighbours face_neighbours(const HexMesh& mesh) {
  // Faces are bucketed by their smallest vertex: a bucket is small, so matching needs no hash and no global sort.
  struct Face {
    SortedQuad key;
    HexId hex;
    std::int8_t face;
  };
  const std::size_t vertex_count = mesh.position.size();
  std::vector<std::int64_t> offset(vertex_count + 1, 0);
  const auto smallest = [&](HexId h, int f) {
    const QuadVertices q = face_vertices(mesh.hexes[h], f);
    return std::min({q[0], q[1], q[2], q[3]});
  };
  for (HexId h : mesh.hexes.ids())
    for (int f = 0; f < 6; ++f) ++offset[smallest(h, f).index() + 1];
  for (std::size_t v = 0; v < vertex_count; ++v) offset[v + 1] += offset[v];
  std::vector<Face> faces(mesh.hexes.size() * 6);
  {
    std::vector<std::int64_t> next(offset.begin(), offset.end() - 1);
    for (HexId h : mesh.hexes.ids())
      for (int f = 0; f < 6; ++f)
        faces[static_cast<std::size_t>(next[smallest(h, f).index()]++)] = {sorted(face_vertices(mesh.hexes[h], f)), h,
                                                                           static_cast<std::int8_t>(f)};
  }
  FaceNeighbours result(mesh.hexes.size());
  parallel_for(vertex_count, [&](std::size_t v) {
    const auto begin = faces.begin() + offset[v], end = faces.begin() + offset[v + 1];
    std::sort(begin, end, [](const Face& a, const Face& b) {
      return a.key != b.key ? a.key < b.key : (a.hex != b.hex ? a.hex < b.hex : a.face < b.face);
    });
    for (auto at = begin; at != end;) {
      auto stop = at + 1;
      while (stop != end && stop->key == at->key) ++stop;
      if (stop - at > 2) throw_broken("a hex face is shared by more than two hexes");
      if (stop - at == 2) {
        result[at->hex][static_cast<std::size_t>(at->face)] = {at[1].hex, at[1].face};
        result[at[1].hex][static_cast<std::size_t>(at[1].face)] = {at->hex, at->face};
      }
      at = stop;
    }
  });
  return result;
}

IdMap<QuadId, QuadSides> quad_sides(const HexMesh& mesh) {
  IdMap<VertexId, std::uint8_t> begins_quad(mesh.position.size(), 0);
  for (const QuadVertices& quad : mesh.quads) begins_quad[quad[0]] = 1;
  const auto star = stars<HexId>(mesh.position.size(), mesh.hexes, [&](VertexId v) { return begins_quad[v] != 0; });
  IdMap<QuadId, QuadSides> result(mesh.quads.size());
  parallel_for(mesh.quads.size(), [&](std::size_t i) {
    const QuadId q(i);
    const QuadVertices& quad = mesh.quads[q];
    const SortedQuad key = sorted(quad);
    for (HexId h : star.of(quad[0])) {
      const HexVertices& hex = mesh.hexes[h];
      if (std::find(hex.begin(), hex.end(), quad[2]) == hex.end()) continue;
      for (int f = 0; f < 6; ++f) {
        const QuadVertices face = face_vertices(hex, f);
        if (sorted(face) != key) continue;
        if (same_turn(quad, face)) {
          result[q].back = h;
          result[q].back_face = static_cast<std::int8_t>(f);
        } else {
          result[q].front = h;
          result[q].front_face = static_cast<std::int8_t>(f);
        }
      }
    }
  });
  return result;
}

}  // namespace strata
