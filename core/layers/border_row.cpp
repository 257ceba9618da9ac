#include "core/layers/border_row.h"

#include <algorithm>
#include <array>

#include "core/layers/columns.h"
#include "core/mesh/adjacency.h"
#include "core/optimise/optimise.h"
#include "core/quality/quality.h"
#include "core/sheets/insert_sheet.h"

namespace strata {
namespace {

constexpr double kShare = 0.4;      // of the edges that the new layer cuts off
constexpr int kTries = 4;           // with half the share each time
constexpr int kRings = 3;
constexpr int kSweeps = 5;

std::int64_t not_positive(const HexMesh& mesh) {
  std::int64_t count = 0;
  for (const HexVertices& hex : mesh.hexes) {
    std::array<Vec3, 8> c;
    for (std::size_t i = 0; i < 8; ++i) c[i] = mesh.position[hex[i]];
    count += !(corner_scaled_jacobian(c) > 0);
  }
  return count;
}

// Round the hexes that see the facets for which `sits_on` holds.
template <class SitsOn>
SheetRequest round_hexes(const HexMesh& mesh, const Facets& facets, const SitsOn& sits_on) {
  SheetRequest request;
  request.strip = StripTakes::Inner;
  request.inner.assign(mesh.hexes.size(), 0);
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f)
    if (facets.exists(f) && sits_on(f)) request.inner[facets.hex_face(f).hex] = 1;
  request.faces = faces_between(mesh, request.inner);
  // A hex with a second quad, beyond the border: the sheet passes between it and that quad.
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f) || facets.on_interface(f)) continue;
    const FaceNeighbour at = facets.hex_face(f);
    if (request.inner[at.hex] && !sits_on(f)) request.faces.push_back({at.hex, at.face});
  }
  return request;
}

// How each copy moves away from its old vertex: towards the vertices beside it that the sheet does not touch, on the surface if it is on
// the surface; else towards the middle of its inner hexes.
IdMap<VertexId, Vec3> pulls(const HexMesh& mesh, const Sheet& sheet, HexId first_new) {
  const std::size_t old = sheet.inner_copy.size();
  const auto is_copy = [&](VertexId v) { return v.index() >= old; };
  struct Sum {
    Vec3 of = Vec3::Zero();
    int count = 0;
    void add(const Vec3& d) { of += d, ++count; }
    [[nodiscard]] Vec3 mean() const { return count > 0 ? Vec3(of / count) : Vec3(Vec3::Zero()); }
  };
  IdMap<VertexId, Sum> along(mesh.position.size()), inside(mesh.position.size()), middle(mesh.position.size());
  const auto beside = [&](IdMap<VertexId, Sum>& sums, VertexId a, VertexId b) {
    if (is_copy(a) && !is_copy(b)) sums[a].add(mesh.position[b] - mesh.position[a]);
  };
  for (std::size_t h = 0; h < first_new.index(); ++h) {
    const HexVertices& hex = mesh.hexes[HexId(h)];
    if (std::none_of(hex.begin(), hex.end(), is_copy)) continue;
    Vec3 centre = Vec3::Zero();
    for (VertexId v : hex) centre += 0.125 * mesh.position[v];
    for (VertexId v : hex)
      if (is_copy(v)) middle[v].add(centre - mesh.position[v]);
    for (const auto& edge : kHexEdges) {
      const VertexId a = hex[static_cast<std::size_t>(edge[0])], b = hex[static_cast<std::size_t>(edge[1])];
      beside(inside, a, b), beside(inside, b, a);
    }
  }
  for (QuadId q : mesh.quads.ids()) {
    const QuadVertices& quad = mesh.quads[q];
    // Strips join copies to their old vertices; these are not beside.
    if (q.index() >= sheet.first_strip.index()) continue;
    for (std::size_t i = 0; i < 4; ++i) beside(along, quad[i], quad[(i + 1) & 3]), beside(along, quad[(i + 1) & 3], quad[i]);
  }
  IdMap<VertexId, Vec3> pull(mesh.position.size(), Vec3::Zero());
  for (VertexId v : pull.ids()) {
    if (!is_copy(v)) continue;
    const Sum& best = along[v].count > 0 ? along[v] : (inside[v].count > 0 ? inside[v] : middle[v]);
    pull[v] = best.mean();
  }
  return pull;
}

std::optional<HexMesh> wrapped_in(const HexMesh& mesh, const SheetRequest& request, const Ground& ground, Context& context) {
  if (request.faces.empty() || !pinched_vertices(mesh, request).empty()) return std::nullopt;
  const std::int64_t allowed = not_positive(mesh);
  SheetInsertion inserted = insert_sheet(mesh, request);
  HexMesh& wrapped = inserted.mesh;
  attach_copies(wrapped, inserted.sheet.inner_copy, IdMap<VertexId, Vec3>(mesh.position.size(), Vec3::Zero()), ground);
  const IdMap<VertexId, Vec3> pull = pulls(wrapped, inserted.sheet, inserted.sheet.first_hex);
  IdMap<VertexId, std::uint8_t> seeds(wrapped.position.size(), 0);
  for (VertexId v : seeds.ids()) seeds[v] = v.index() >= mesh.position.size();
  const IdMap<VertexId, Vec3> start = wrapped.position;
  double share = kShare;
  for (int i = 0; i < kTries; ++i, share *= 0.5) {
    for (VertexId v : seeds.ids())
      if (seeds[v]) wrapped.position[v] = ground.project(wrapped.attachment[v], start[v] + share * pull[v]).position;
    if (not_positive(wrapped) <= allowed) break;
  }
  OptimiseRequest optimise_request;
  optimise_request.ground = &ground;
  optimise_request.seeds = &seeds;
  OptimiseOptions options;
  options.rings = kRings;
  options.sweeps = kSweeps;
  HexMesh result = optimise(std::move(wrapped), optimise_request, options, context).mesh;
  if (not_positive(result) > allowed) return std::nullopt;
  return result;
}

}  // namespace

std::optional<HexMesh> add_border_row(const HexMesh& mesh, const std::vector<FrontIndex>& fronts, const Ground& ground, Context& context) {
  const Facets facets(mesh);
  const auto on_fronts = [&](FacetIndex f) { return std::binary_search(fronts.begin(), fronts.end(), facets.front(f)); };
  return wrapped_in(mesh, round_hexes(mesh, facets, on_fronts), ground, context);
}

std::optional<HexMesh> add_row_round(const HexMesh& mesh, const std::vector<QuadId>& quads, const Ground& ground, Context& context) {
  const Facets facets(mesh);
  const auto on_interface = [&](QuadId q) { return facets.on_interface(facet_of(q, FacetSide::Back)); };
  if (std::any_of(quads.begin(), quads.end(), on_interface)) return std::nullopt;
  const auto on_quads = [&](FacetIndex f) { return std::binary_search(quads.begin(), quads.end(), quad_of(f)); };
  return wrapped_in(mesh, round_hexes(mesh, facets, on_quads), ground, context);
}

}  // namespace strata
