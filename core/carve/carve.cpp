#include "core/carve/carve.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/context.h"
#include "core/base/diagnostic.h"
#include "core/base/parallel.h"
#include "core/carve/clean_skin.h"
#include "core/carve/colour.h"
#include "core/carve/thin_places.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

// What the colours of a hex's nodes say.
struct Vote {
  std::int32_t region = kVoid;  // most frequent region, ties to the smaller
  bool unanimous = true;        // no node is void or undecided
};
Vote count_votes(const HexVertices& hex, const IdMap<VertexId, std::int32_t>& colour) {
  Vote vote;
  int most = 0;
  for (VertexId v : hex) {
    const std::int32_t c = colour[v];
    if (c < 0) {
      vote.unanimous = false;
      continue;
    }
    int count = 0;
    for (VertexId w : hex) count += colour[w] == c ? 1 : 0;
    if (count > most || (count == most && c < vote.region)) {
      vote.region = c;
      most = count;
    }
  }
  return vote;
}

struct Carver {
  const Dual& dual;
  const Locator& locator;
  const Locator& walls;  // all of the surface but interfaces
  const NodeColours& colours;
  double depth;

  [[nodiscard]] Vec3 centre(HexId h) const {
    Vec3 sum = Vec3::Zero();
    for (VertexId v : dual.mesh.hexes[h]) sum += dual.mesh.position[v];
    return sum / 8;
  }
  [[nodiscard]] double cell_size(HexId h) const {
    double sum = 0;
    for (VertexId v : dual.mesh.hexes[h]) sum += static_cast<double>(dual.cell_size[v]);
    return sum / 8;
  }
  // The region the hex's centre lies in: that of a node that sees it, the favourite first.
  [[nodiscard]] std::int32_t region_of_centre(HexId h, std::int32_t favourite) const {
    const Vec3 c = centre(h);
    for (bool first : {true, false})
      for (VertexId v : dual.mesh.hexes[h]) {
        const std::int32_t r = colours.colour[v];
        if (r >= 0 && (r == favourite) == first && sees(locator, c, dual.mesh.position[v])) return r;
      }
    return kVoid;
  }
  // Room for the buffer layer between the centre and the walls. An interface is none: both its sides are meshed.
  [[nodiscard]] bool has_room(HexId h) const { return !walls.closest(centre(h), depth * cell_size(h)).triangle.valid(); }
  void choose(HexId h, HexChoice& choice) const {
    const Vote vote = count_votes(dual.mesh.hexes[h], colours.colour);
    if (vote.region < 0) return;
    if (vote.unanimous) {
      choice.label[h] = vote.region;
      return;
    }
    choice.fillable[h] = region_of_centre(h, vote.region);
    if (choice.fillable[h] >= 0 && has_room(h)) choice.label[h] = choice.fillable[h];
  }
};

// Empty when there is no interface.
std::optional<Locator> walls_without_interfaces(const Surface& surface, const IdMap<TriangleId, Bounds>& bounds) {
  std::vector<TriangleId> walls;
  for (TriangleId t : bounds.ids())
    if (bounds[t] != Bounds::Interface) walls.push_back(t);
  if (walls.size() == bounds.size()) return {};
  return Locator(surface, std::move(walls));
}

HexChoice choose_hexes(const Carver& carver) {
  const std::size_t count = carver.dual.mesh.hexes.size();
  HexChoice choice;
  choice.label.assign(count, kVoid);
  choice.fillable.assign(count, kVoid);
  choice.thin.assign(count, 0);
  parallel_for(count, [&](std::size_t i) { carver.choose(HexId(i), choice); }, 256);
  return choice;
}

// Leaves only the hexes that touch a kept or fillable one: what the repair needs to see.
void keep_neighbourhood(HexMesh& mesh, HexChoice& choice) {
  IdMap<VertexId, std::uint8_t> near(mesh.position.size(), std::uint8_t{0});
  for (HexId h : mesh.hexes.ids())
    if (choice.label[h] >= 0 || choice.fillable[h] >= 0)
      for (VertexId v : mesh.hexes[h]) near[v] = 1;
  std::size_t kept = 0;
  for (HexId h : mesh.hexes.ids()) {
    if (std::none_of(mesh.hexes[h].begin(), mesh.hexes[h].end(), [&](VertexId v) { return near[v] != 0; })) continue;
    const HexId to(kept++);
    mesh.hexes[to] = mesh.hexes[h];
    choice.label[to] = choice.label[h];
    choice.fillable[to] = choice.fillable[h];
    choice.thin[to] = choice.thin[h];
  }
  mesh.hexes.resize(kept);
  choice.label.resize(kept);
  choice.fillable.resize(kept);
  choice.thin.resize(kept);
}

// Kept hexes and their vertices, order kept.
HexMesh compact(const HexMesh& mesh, const HexChoice& choice) {
  HexMesh result;
  IdMap<VertexId, VertexId> renumbered(mesh.position.size());
  for (HexId h : mesh.hexes.ids())
    if (choice.label[h] >= 0)
      for (VertexId v : mesh.hexes[h]) renumbered[v] = VertexId(0);
  for (VertexId v : mesh.position.ids())
    if (renumbered[v].valid()) renumbered[v] = result.position.push_back(Vec3(mesh.position[v]));
  result.attachment.resize(result.position.size());
  for (HexId h : mesh.hexes.ids()) {
    if (choice.label[h] < 0) continue;
    HexVertices hex = mesh.hexes[h];
    for (VertexId& v : hex) v = renumbered[v];
    result.hexes.push_back(hex);
    result.region.push_back(RegionId(choice.label[h]));
  }
  result.layer.assign(result.hexes.size(), 0);
  return result;
}

// Boundary faces outwards; interfaces once, out of the smaller region.
void emit_quads(HexMesh& mesh) {
  const FaceNeighbours neighbours = face_neighbours(mesh);
  for (HexId h : mesh.hexes.ids())
    for (int f = 0; f < 6; ++f) {
      const HexId other = neighbours[h][static_cast<std::size_t>(f)].hex;
      if (other.valid() && mesh.region[other] <= mesh.region[h]) continue;
      mesh.quads.push_back(face_vertices(mesh.hexes[h], f));
    }
  mesh.patch.resize(mesh.quads.size());
  mesh.chart.resize(mesh.quads.size());
}

// Regions that cells cannot show: an error when none is left, else a warning for those asked for by a point, and new numbers for the
// rest where numbers are ours to give.
void settle_regions(HexMesh& mesh, std::int32_t regions, VolumeMode mode, Context& context) {
  std::vector<std::int64_t> count(static_cast<std::size_t>(regions), 0);
  for (RegionId r : mesh.region) ++count[r.index()];
  if (mesh.hexes.empty()) {
    Diagnostic diagnostic;
    diagnostic.reason = Reason::RegionTooThin;
    diagnostic.message = "the enclosed volume is thinner than the cells everywhere: ask for smaller cells";
    diagnostic.field = "volume";
    throw MeshError(Failure::InvalidInput, std::move(diagnostic));
  }
  std::vector<RegionId> renumbered;
  std::int32_t next = 0;
  for (std::size_t r = 0; r < count.size(); ++r) {
    if (mode != VolumeMode::Points) {
      renumbered.push_back(RegionId(next));
      next += count[r] > 0 ? 1 : 0;
      continue;
    }
    renumbered.push_back(RegionId(r));
    if (count[r] > 0) continue;
    Diagnostic diagnostic;
    diagnostic.reason = Reason::RegionTooThin;
    diagnostic.severity = Severity::Warning;
    diagnostic.message = "region " + std::to_string(r + 1) + " is thinner than the cells: it is not meshed";
    diagnostic.field = "volume.points[" + std::to_string(r) + "]";
    context.adjusted(std::move(diagnostic));
  }
  for (RegionId& r : mesh.region) r = renumbered[r.index()];
}

}  // namespace

Carved carve(Dual dual, const Surface& surface, const Locator& locator, const CarveOptions& options, Context& context) {
  NodeColours colours = colour_nodes(dual, surface, locator, options.volume, context);
  context.checkpoint();
  const std::optional<Locator> walls = walls_without_interfaces(surface, colours.bounds);
  const Locator& only_walls = walls ? *walls : locator;
  HexChoice choice = choose_hexes({dual, locator, only_walls, colours, options.depth});
  if (options.thin_places) keep_thin_places({dual, surface, locator, only_walls, colours}, choice);
  context.checkpoint();
  HexMesh mesh = std::move(dual.mesh);
  keep_neighbourhood(mesh, choice);
  clean_skin(mesh, choice);
  context.checkpoint();
  mesh = compact(mesh, choice);
  settle_regions(mesh, colours.regions, options.volume.mode, context);
  emit_quads(mesh);
  return {std::move(mesh), std::move(colours.bounds)};
}

}  // namespace strata
