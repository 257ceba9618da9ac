#include "core/sheets/insert_sheet.h"

#include <algorithm>
#include <array>
#include <optional>

#include "core/base/parallel.h"
#include "core/sheets/sheet_star.h"

namespace strata {
namespace {

constexpr std::size_t kSheetGrain = 256;  // vertices or faces per task; each costs a microsecond or two

// One of the three faces a hex has at a vertex, with the hex's place in the vertex's star.
struct CornerFace {
  SortedFace key;
  std::int32_t hex;
  bool open;
};

int find_root(std::vector<int>& parent, int i) {
  while (parent[static_cast<std::size_t>(i)] != i) i = parent[static_cast<std::size_t>(i)];
  return i;
}

// The hexes round v, split along the sheet, must be one inner fan and at most one outer fan; every face between an inner and
// an outer hex must be in the sheet, and no other.
bool fans_are_single(const HexMesh& mesh, const SheetStar& star, VertexId v) {
  const auto hexes = star.hexes_of(v);
  std::vector<CornerFace> faces;
  faces.reserve(hexes.size() * 3);
  for (std::size_t i = 0; i < hexes.size(); ++i)
    for (int f = 0; f < 6; ++f) {
      const QuadVertices q = face_vertices(mesh.hexes[hexes[i]], f);
      if (std::find(q.begin(), q.end(), v) == q.end()) continue;
      faces.push_back({sorted_face(q), static_cast<std::int32_t>(i), star.is_open(hexes[i], f)});
    }
  std::sort(faces.begin(), faces.end(),
            [](const CornerFace& a, const CornerFace& b) { return a.key != b.key ? a.key < b.key : a.hex < b.hex; });
  std::vector<int> parent(hexes.size());
  for (std::size_t i = 0; i < parent.size(); ++i) parent[i] = static_cast<int>(i);
  const auto inner = [&](const CornerFace& f) { return star.is_inner(hexes[static_cast<std::size_t>(f.hex)]); };
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const CornerFace& a = faces[i];
    if (a.open && !inner(a)) return false;
    if (i + 1 == faces.size() || faces[i + 1].key != a.key) continue;
    const CornerFace& b = faces[++i];
    if (b.open && !inner(b)) return false;
    const bool crosses = inner(a) != inner(b);
    if ((a.open || b.open) != crosses) return false;
    if (crosses) continue;
    const int ra = find_root(parent, a.hex), rb = find_root(parent, b.hex);
    parent[static_cast<std::size_t>(std::max(ra, rb))] = std::min(ra, rb);
  }
  int inner_fans = 0, outer_fans = 0;
  for (std::size_t i = 0; i < hexes.size(); ++i)
    if (parent[i] == static_cast<int>(i)) ++(star.is_inner(hexes[i]) ? inner_fans : outer_fans);
  return inner_fans == 1 && outer_fans <= 1;
}

// The sheet's faces round v must follow one another over shared edges, in one path or one ring.
bool faces_are_one_run(const SheetStar& star, VertexId v) {
  const auto faces = star.faces_of(v);
  std::vector<std::array<VertexId, 2>> links;  // the two edges of each face at v, by their far ends
  for (std::int32_t i : faces) {
    const QuadVertices q = star.face(i);
    const auto at = static_cast<std::size_t>(std::find(q.begin(), q.end(), v) - q.begin());
    links.push_back({q[(at + 1) & 3], q[(at + 3) & 3]});
  }
  std::vector<int> parent(links.size());
  for (std::size_t i = 0; i < parent.size(); ++i) parent[i] = static_cast<int>(i);
  std::size_t joins = 0;
  for (std::size_t i = 0; i < links.size(); ++i)
    for (VertexId far : links[i]) {
      int uses = 0;
      for (std::size_t j = 0; j < links.size(); ++j) {
        if (links[j][0] != far && links[j][1] != far) continue;
        ++uses;
        const int ri = find_root(parent, static_cast<int>(i)), rj = find_root(parent, static_cast<int>(j));
        if (ri == rj) continue;
        parent[static_cast<std::size_t>(std::max(ri, rj))] = std::min(ri, rj);
        ++joins;
      }
      if (uses > 2) return false;
    }
  return joins + 1 == links.size();
}

// Which quads go with the shrunk hexes: those on an inner hex that are not themselves opened.
bool goes_inwards(const HexMesh& mesh, const SheetStar& star, QuadId q) {
  const QuadVertices& quad = mesh.quads[q];
  const SortedFace key = sorted_face(quad);
  VertexId anchor;
  for (VertexId v : quad)
    if (star.local(v) >= 0) anchor = v;
  bool inner = false;
  for (HexId h : star.hexes_of(anchor))
    for (int f = 0; f < 6; ++f) {
      if (sorted_face(face_vertices(mesh.hexes[h], f)) != key) continue;
      if (star.is_open(h, f)) return false;
      inner = inner || star.is_inner(h);
    }
  return inner;
}

struct Strip {
  QuadVertices quad;
  QuadId like;  // takes this quad's labels
};

// Any quad at the edge (a, b) between the two regions; where the sheet crosses an interface.
QuadId interface_quad_at(const HexMesh& mesh, const SheetStar& star, VertexId a, VertexId b, bool wants_inner) {
  QuadId fallback;
  for (QuadId q : star.quads_of(a)) {
    const QuadVertices& quad = mesh.quads[q];
    if (std::find(quad.begin(), quad.end(), b) == quad.end()) continue;
    if (goes_inwards(mesh, star, q) == wants_inner) return q;
    if (!fallback.valid()) fallback = q;
  }
  return fallback;
}

// A new quad over the edge from a to b of sheet face i, where the sheet leaves the volume or crosses an interface.
std::optional<Strip> strip_over(const HexMesh& mesh, const SheetStar& star, const SheetRequest& request, std::int32_t i, VertexId a,
                                VertexId b, const IdMap<VertexId, VertexId>& copy) {
  const HexFace& face = request.faces[static_cast<std::size_t>(i)];
  const QuadVertices outwards{b, a, copy[a], copy[b]};
  const bool inner = request.strip == StripTakes::Inner;
  if (const auto other = star.other_face_at(i, a, b)) {
    if (*other < i) return std::nullopt;
    const RegionId here = mesh.region[face.hex], there = mesh.region[request.faces[static_cast<std::size_t>(*other)].hex];
    if (here == there) return std::nullopt;
    const QuadVertices quad = here < there ? outwards : QuadVertices{a, b, copy[b], copy[a]};
    return Strip{quad, interface_quad_at(mesh, star, a, b, inner)};
  }
  if (inner) return Strip{outwards, star.walk_to_boundary(face.hex, face.face, a, b)};
  const FaceNeighbour beyond = star.across(face.hex, face.face);
  if (!beyond.hex.valid()) return Strip{outwards, star.quad_on(face.hex, face.face)};
  return Strip{outwards, star.walk_to_boundary(beyond.hex, beyond.face, a, b)};
}

std::vector<Strip> make_strips(const HexMesh& mesh, const SheetStar& star, const SheetRequest& request,
                               const IdMap<VertexId, VertexId>& copy) {
  std::vector<std::array<std::optional<Strip>, 4>> found(request.faces.size());
  parallel_for(
      request.faces.size(),
      [&](std::size_t i) {
        const QuadVertices q = star.face(static_cast<std::int32_t>(i));
        for (std::size_t j = 0; j < 4; ++j)
          found[i][j] = strip_over(mesh, star, request, static_cast<std::int32_t>(i), q[j], q[(j + 1) & 3], copy);
      },
      kSheetGrain);
  std::vector<Strip> strips;
  for (const auto& four : found)
    for (const auto& strip : four)
      if (strip) strips.push_back(*strip);
  return strips;
}

// Corners 0-3 on the old vertices (the outer side), 4-7 on the copies.
HexVertices hex_over(const QuadVertices& q, const IdMap<VertexId, VertexId>& copy) {
  return {q[0], q[3], q[2], q[1], copy[q[0]], copy[q[3]], copy[q[2]], copy[q[1]]};
}

template <class Row>
void move_to_copies(Row& row, const IdMap<VertexId, VertexId>& copy) {
  for (VertexId& v : row)
    if (copy[v].valid()) v = copy[v];
}

}  // namespace

std::vector<VertexId> pinched_vertices(const HexMesh& mesh, const SheetRequest& request) {
  const SheetStar star(mesh, request);
  const auto& vertices = star.vertices();
  std::vector<std::uint8_t> pinched(vertices.size(), 0);
  parallel_for(
      vertices.size(),
      [&](std::size_t i) { pinched[i] = !fans_are_single(mesh, star, vertices[i]) || !faces_are_one_run(star, vertices[i]); }, kSheetGrain);
  std::vector<VertexId> result;
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (pinched[i] != 0) result.push_back(vertices[i]);
  return result;
}

std::vector<HexFace> faces_between(const HexMesh& mesh, const IdMap<HexId, std::uint8_t>& inner) {
  IdMap<VertexId, std::uint8_t> touched(mesh.position.size(), std::uint8_t{0});
  for (HexId h : mesh.hexes.ids())
    if (inner[h] != 0)
      for (VertexId v : mesh.hexes[h]) touched[v] = 1;
  struct Side {
    SortedFace key;
    HexFace face;
    bool inner;
  };
  std::vector<Side> sides;
  for (HexId h : mesh.hexes.ids()) {
    int marked = 0;
    for (VertexId v : mesh.hexes[h]) marked += touched[v];
    if (marked < 4) continue;
    for (int f = 0; f < 6; ++f) {
      const QuadVertices q = face_vertices(mesh.hexes[h], f);
      if (std::all_of(q.begin(), q.end(), [&](VertexId v) { return touched[v] != 0; }))
        sides.push_back({sorted_face(q), {h, static_cast<std::int8_t>(f)}, inner[h] != 0});
    }
  }
  parallel_sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    if (a.key != b.key) return a.key < b.key;
    return a.face.hex != b.face.hex ? a.face.hex < b.face.hex : a.face.face < b.face.face;
  });
  std::vector<HexFace> faces;
  for (std::size_t i = 0; i + 1 < sides.size(); ++i)
    if (sides[i].key == sides[i + 1].key && sides[i].inner != sides[i + 1].inner)
      faces.push_back(sides[i].inner ? sides[i].face : sides[i + 1].face);
  parallel_sort(faces.begin(), faces.end(),
                [](const HexFace& a, const HexFace& b) { return a.hex != b.hex ? a.hex < b.hex : a.face < b.face; });
  return faces;
}

SheetInsertion insert_sheet(HexMesh mesh, const SheetRequest& request) {
  const SheetStar star(mesh, request);
  SheetInsertion result;
  auto& copy = result.sheet.inner_copy;
  copy.resize(mesh.position.size());
  const std::size_t old_vertices = mesh.position.size();
  mesh.position.reserve(old_vertices + star.vertices().size());
  for (VertexId v : star.vertices()) {
    copy[v] = mesh.position.push_back(Vec3(mesh.position[v]));
    mesh.attachment.push_back(Attachment(mesh.attachment[v]));
  }

  // Everything that is read from the mesh as it was, before it changes.
  const std::vector<Strip> strips = make_strips(mesh, star, request, copy);
  std::vector<std::uint8_t> quad_moves(star.quads().size(), 0);
  parallel_for(star.quads().size(), [&](std::size_t i) { quad_moves[i] = goes_inwards(mesh, star, star.quads()[i]); }, kSheetGrain);
  std::vector<HexVertices> layer(request.faces.size());
  for (std::size_t i = 0; i < layer.size(); ++i) layer[i] = hex_over(star.face(static_cast<std::int32_t>(i)), copy);

  for (HexId h : star.hexes())
    if (star.is_inner(h)) move_to_copies(mesh.hexes[h], copy);
  for (std::size_t i = 0; i < quad_moves.size(); ++i)
    if (quad_moves[i] != 0) move_to_copies(mesh.quads[star.quads()[i]], copy);

  result.sheet.first_hex = mesh.hexes.next_id();
  for (std::size_t i = 0; i < layer.size(); ++i) {
    mesh.hexes.push_back(layer[i]);
    mesh.region.push_back(RegionId(mesh.region[request.faces[i].hex]));
    mesh.layer.push_back(0);
  }
  result.sheet.first_strip = mesh.quads.next_id();
  for (const Strip& strip : strips) {
    mesh.quads.push_back(strip.quad);
    mesh.patch.push_back(strip.like.valid() ? PatchId(mesh.patch[strip.like]) : PatchId{});
    mesh.chart.push_back(strip.like.valid() ? ChartId(mesh.chart[strip.like]) : ChartId{});
  }
  result.mesh = std::move(mesh);
  return result;
}

}  // namespace strata
