#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/base/parallel.h"
#include "core/buffer/thicken.h"
#include "core/buffer/wrap.h"
#include "core/mesh/adjacency.h"
#include "core/sheets/insert_sheet.h"

namespace strata {
namespace {

constexpr double kOutwardShare = 0.4;  // of the local edge: the skin was carved about that much below the surface
constexpr double kInwardShare = 0.3;   // of the local edge: at interfaces there is no room but the regions' own

[[noreturn]] void throw_pinched(const HexMesh& mesh, VertexId v, std::size_t count) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.message = "the carved skin is pinched at " + std::to_string(count) + " vertices: the buffer layer cannot be inserted";
  diagnostic.count = static_cast<std::int64_t>(count);
  diagnostic.box.add(mesh.position[v]);
  throw MeshError(Failure::Internal, std::move(diagnostic));
}

// Regions of one colour share no vertex and are wrapped by one sheet. Colours by ascending region, greedily.
IdMap<RegionId, std::int32_t> colour_regions(const HexMesh& mesh) {
  std::size_t count = 0;
  for (RegionId r : mesh.region) count = std::max(count, r.index() + 1);
  IdMap<VertexId, RegionId> first(mesh.position.size());
  IdMap<VertexId, std::uint8_t> shared(mesh.position.size(), std::uint8_t{0});
  for (HexId h : mesh.hexes.ids())
    for (VertexId v : mesh.hexes[h]) {
      if (!first[v].valid()) first[v] = mesh.region[h];
      if (first[v] != mesh.region[h]) shared[v] = 1;
    }
  std::vector<std::pair<VertexId, RegionId>> meetings;
  for (HexId h : mesh.hexes.ids())
    for (VertexId v : mesh.hexes[h])
      if (shared[v] != 0) meetings.emplace_back(v, mesh.region[h]);
  parallel_sort(meetings.begin(), meetings.end());
  meetings.erase(std::unique(meetings.begin(), meetings.end()), meetings.end());
  IdMap<RegionId, std::vector<RegionId>> smaller(count);  // neighbours of smaller id
  for (std::size_t i = 0; i < meetings.size(); ++i)
    for (std::size_t j = i + 1; j < meetings.size() && meetings[j].first == meetings[i].first; ++j) {
      auto& list = smaller[meetings[j].second];
      if (std::find(list.begin(), list.end(), meetings[i].second) == list.end()) list.push_back(meetings[i].second);
    }
  IdMap<RegionId, std::int32_t> colour(count, 0);
  for (RegionId r : colour.ids()) {
    std::int32_t free = 0;
    while (std::any_of(smaller[r].begin(), smaller[r].end(), [&](RegionId other) { return colour[other] == free; })) ++free;
    colour[r] = free;
  }
  return colour;
}

// A boundary vertex and what its regions' copies of it became.
struct Lift {
  VertexId vertex;
  RegionId region;
  VertexId copy;
};

SheetRequest round_regions(const HexMesh& mesh, const IdMap<RegionId, std::int32_t>& colour, std::int32_t wanted) {
  SheetRequest request;
  request.inner.resize(mesh.hexes.size());
  for (HexId h : mesh.hexes.ids()) request.inner[h] = colour[mesh.region[h]] == wanted;
  for (const QuadSides& sides : quad_sides(mesh)) {
    if (sides.back.valid() && request.inner[sides.back] != 0) request.faces.push_back({sides.back, sides.back_face});
    if (sides.front.valid() && request.inner[sides.front] != 0) request.faces.push_back({sides.front, sides.front_face});
  }
  return request;
}

// Corners 0-3 of a new hex lie outside, 4-7 are their copies.
void note_lifts(const HexMesh& mesh, const Sheet& sheet, std::vector<Lift>& lifts) {
  std::vector<Lift> fresh;
  for (HexId h = sheet.first_hex; h < mesh.hexes.next_id(); h = HexId(h.value + 1))
    for (std::size_t c = 0; c < 4; ++c) fresh.push_back({mesh.hexes[h][c], mesh.region[h], mesh.hexes[h][c + 4]});
  std::sort(fresh.begin(), fresh.end(), [](const Lift& a, const Lift& b) { return a.copy < b.copy; });
  const auto same = [](const Lift& a, const Lift& b) { return a.copy == b.copy; };
  fresh.erase(std::unique(fresh.begin(), fresh.end(), same), fresh.end());
  lifts.insert(lifts.end(), fresh.begin(), fresh.end());
}

struct SkinGeometry {
  VertexStars<QuadId> round;
  IdMap<QuadId, Vec3> normal;
  IdMap<QuadId, std::array<RegionId, 2>> regions;  // behind, in front
};

SkinGeometry skin_geometry(const HexMesh& mesh) {
  SkinGeometry skin;
  skin.round = quads_round_vertices(mesh);
  const IdMap<QuadId, QuadSides> sides = quad_sides(mesh);
  skin.normal.resize(mesh.quads.size());
  skin.regions.resize(mesh.quads.size());
  for (QuadId q : mesh.quads.ids()) {
    const QuadVertices& v = mesh.quads[q];
    skin.normal[q] = (mesh.position[v[2]] - mesh.position[v[0]]).cross(mesh.position[v[3]] - mesh.position[v[1]]).normalized();
    if (sides[q].back.valid()) skin.regions[q][0] = mesh.region[sides[q].back];
    if (sides[q].front.valid()) skin.regions[q][1] = mesh.region[sides[q].front];
  }
  return skin;
}

// Mean length of the quads' edges at v.
double edge_length(const HexMesh& mesh, const SkinGeometry& skin, VertexId v) {
  double sum = 0;
  int count = 0;
  for (QuadId q : skin.round.of(v)) {
    const QuadVertices& quad = mesh.quads[q];
    const auto at = static_cast<std::size_t>(std::find(quad.begin(), quad.end(), v) - quad.begin());
    sum += (mesh.position[quad[(at + 1) & 3]] - mesh.position[v]).norm();
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

bool on_interface(const SkinGeometry& skin, VertexId v) {
  const auto quads = skin.round.of(v);
  return std::any_of(quads.begin(), quads.end(), [&](QuadId q) { return skin.regions[q][1].valid(); });
}

// Outer vertices go outwards; where regions meet, their copies go inwards. Everything is read from the skin before the wrap.
std::vector<Push> plan_pushes(const HexMesh& mesh, const SkinGeometry& skin, const std::vector<Lift>& lifts) {
  std::vector<Push> pushes;
  std::vector<Vec3> normals;
  for (std::size_t i = 0; i < skin.round.offset.size() - 1; ++i) {
    const VertexId v(i);
    normals.clear();
    for (QuadId q : skin.round.of(v))
      if (!skin.regions[q][1].valid()) normals.push_back(skin.normal[q]);
    if (!normals.empty()) pushes.push_back({v, kOutwardShare * edge_length(mesh, skin, v) * visible_direction(normals)});
  }
  for (const Lift& lift : lifts) {
    if (!on_interface(skin, lift.vertex)) continue;
    normals.clear();
    for (QuadId q : skin.round.of(lift.vertex)) {
      if (skin.regions[q][0] == lift.region) normals.push_back(-skin.normal[q]);
      if (skin.regions[q][1] == lift.region) normals.push_back(skin.normal[q]);
    }
    pushes.push_back({lift.copy, kInwardShare * edge_length(mesh, skin, lift.vertex) * visible_direction(normals)});
  }
  return pushes;
}

}  // namespace

HexMesh wrap_surface(HexMesh mesh, Context& context) {
  const IdMap<RegionId, std::int32_t> colour = colour_regions(mesh);
  const SkinGeometry skin = skin_geometry(mesh);
  std::int32_t colours = 0;
  for (std::int32_t c : colour) colours = std::max(colours, c + 1);
  std::vector<Lift> lifts;
  for (std::int32_t c = 0; c < colours; ++c) {
    context.checkpoint();
    const SheetRequest request = round_regions(mesh, colour, c);
    if (const auto pinched = pinched_vertices(mesh, request); !pinched.empty()) throw_pinched(mesh, pinched.front(), pinched.size());
    SheetInsertion done = insert_sheet(std::move(mesh), request);
    mesh = std::move(done.mesh);
    note_lifts(mesh, done.sheet, lifts);
  }
  context.checkpoint();
  push_where_positive(mesh, plan_pushes(mesh, skin, lifts));
  return mesh;
}

}  // namespace strata
