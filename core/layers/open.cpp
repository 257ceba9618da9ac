#include "core/layers/open.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "core/base/parallel.h"
#include "core/layers/proportions.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kOpening = 0.04;        // of the local size: thin enough never to fold the hexes above a sound surface quad
constexpr int kOpeningHalvings = 9;
constexpr double kOpeningQuality = 0.01;  // scaled Jacobian under which a column opens less
constexpr int kUntangleRings = 2;        // round hexes that do not open
constexpr int kUntangleSweeps = 12;
constexpr double kOpeningLoss = 0.5;     // of a poor hex's quality
constexpr double kFlat = 1e-12;          // scaled Jacobian of hexes that have no thickness yet

}  // namespace

Vec3 off_ground(const HexMesh& mesh, const Ground& ground, VertexId v) {
  const Attachment& held = mesh.attachment[v];
  if (held.hold == Hold::Free || held.hold == Hold::Fixed) return Vec3::Zero();
  return mesh.position[v] - ground.project(held, mesh.position[v]).position;
}

Opened open_sheet(HexMesh mesh, const GrowingSheet& sheet, const Ground& ground) {
  const Columns& columns = sheet.columns;
  const VertexStars<HexId> stars = hexes_round_vertices(mesh);
  IdMap<VertexId, std::int32_t> on(mesh.position.size(), -1);
  for (std::size_t c = 0; c < columns.size(); ++c) on[columns.top[c]] = static_cast<std::int32_t>(c);
  std::vector<HexId> round;
  for (VertexId top : columns.top) round.insert(round.end(), stars.of(top).begin(), stars.of(top).end());
  std::sort(round.begin(), round.end());
  round.erase(std::unique(round.begin(), round.end()), round.end());
  std::vector<double> before(round.size());
  parallel_for(round.size(), [&](std::size_t k) { before[k] = corner_scaled_jacobian(corners_of(mesh, round[k])); });
  std::vector<Vec3> off(columns.size());
  parallel_for(columns.size(), [&](std::size_t c) { off[c] = off_ground(mesh, ground, columns.top[c]); });
  std::vector<double> lift(columns.size());
  for (std::size_t c = 0; c < columns.size(); ++c)
    lift[c] = sheet.feet[c].stretch * std::min(sheet.thickness[c], kOpening * sheet.feet[c].size);
  Opened result;
  for (int i = 0; i <= kOpeningHalvings; ++i) {
    parallel_for(columns.size(), [&](std::size_t c) {
      const VertexId top = columns.top[c];
      mesh.position[top] =
          ground.project(mesh.attachment[top], mesh.position[columns.bottom[c]] + lift[c] * sheet.feet[c].direction).position + off[c];
    });
    std::vector<std::uint8_t> poor(round.size(), 0);
    parallel_for(round.size(), [&](std::size_t k) {
      const double quality = corner_scaled_jacobian(corners_of(mesh, round[k]));
      const double enough = before[k] > kFlat ? std::min(kOpeningQuality, kOpeningLoss * before[k]) : kOpeningQuality;
      poor[k] = quality > enough ? 0 : (quality > 0 ? 1 : 2);
    });
    std::vector<std::uint8_t> shrink(columns.size(), 0);
    bool any = false;
    result.flat.clear();
    for (std::size_t k = 0; k < round.size(); ++k) {
      if (poor[k] == 0 || (poor[k] == 1 && i > kOpeningHalvings / 2)) continue;
      for (VertexId v : mesh.hexes[round[k]]) {
        result.flat.push_back(v);
        if (on[v] >= 0) shrink[static_cast<std::size_t>(on[v])] = 1, any = true;
      }
    }
    if (!any || i == kOpeningHalvings) break;
    for (std::size_t c = 0; c < columns.size(); ++c)
      if (shrink[c]) lift[c] *= 0.5;
  }
  result.mesh = std::move(mesh);
  return result;
}

namespace {

int axis_of(const HexVertices& hex, VertexId a, VertexId b) {
  for (std::size_t e = 0; e < 12; ++e) {
    const VertexId u = hex[static_cast<std::size_t>(kHexEdges[e][0])], v = hex[static_cast<std::size_t>(kHexEdges[e][1])];
    if ((u == a && v == b) || (u == b && v == a)) return static_cast<int>(e / 4);
  }
  return -1;
}

}  // namespace

Opened untangle_opening(Opened opened, const GrowingSheet& sheet, const Ground& ground, Context& context) {
  HexMesh mesh = std::move(opened.mesh);
  const VertexStars<HexId> stars = hexes_round_vertices(mesh);
  IdMap<VertexId, std::uint8_t> seeds(mesh.position.size(), 0), movable(mesh.position.size(), 0);
  for (VertexId v : opened.flat) seeds[v] = 1;
  for (VertexId v : movable.ids()) movable[v] = mesh.attachment[v].hold == Hold::Free;
  std::vector<std::pair<VertexId, Attachment>> released;
  const auto release = [&](VertexId v) {
    Attachment& held = mesh.attachment[v];
    if (held.hold != Hold::Chart && held.hold != Hold::Curve) return;
    released.emplace_back(v, held);
    held = {};
    movable[v] = 1;
  };
  // Everything keeps its proportions, but the new sheet's hexes want to be open.
  IdMap<HexId, HexTarget> targets = proportions(mesh);
  for (std::size_t c = 0; c < sheet.columns.size(); ++c) {
    const VertexId bottom = sheet.columns.bottom[c], top = sheet.columns.top[c];
    if (seeds[top]) release(top);
    for (HexId h : stars.of(bottom))
      if (const int axis = axis_of(mesh.hexes[h], bottom, top); axis >= 0)
        targets[h][static_cast<std::size_t>(axis)] = static_cast<float>(kOpening * sheet.feet[c].size);
  }
  for (VertexId bottom : sheet.columns.bottom) movable[bottom] = 0;
  mesh = optimise_near(std::move(mesh), {seeds, movable, targets, kUntangleRings, kUntangleSweeps}, ground, context);
  for (const auto& [v, held] : released) mesh.attachment[v] = held;
  std::vector<VertexId> still;
  for (std::size_t i = 0; i + 8 <= opened.flat.size(); i += 8) {
    const std::span<const VertexId> hex(opened.flat.data() + i, 8);
    std::array<Vec3, 8> c;
    for (std::size_t k = 0; k < 8; ++k) c[k] = mesh.position[hex[k]];
    if (corner_scaled_jacobian(c) <= 0) still.insert(still.end(), hex.begin(), hex.end());
  }
  return {std::move(mesh), std::move(still)};
}

}  // namespace strata
