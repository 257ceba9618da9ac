#include "core/fit/own_side.h"

#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/mesh/adjacency.h"

namespace strata {
namespace {

constexpr double kAgainst =
    0.3;    // cosine between normals of skin and surface: less than minus this is the far side, more than this the own
constexpr double kClear = 0.8;      // of the votes on a component's orientation
constexpr double kReach = 1.5;      // edges, along the normal
constexpr int kWallsBetween = 4;    // looked through on the way, at most
constexpr double kHair = 1e-6;      // edges: off a wall, not to hit it again

// A boundary vertex: which way the skin looks there, and what is closest.
struct Stand {
  VertexId vertex;
  Vec3 outward = Vec3::Zero();
  double edge = 0;  // mean length of the quads' edges
  TriangleId closest;
};

std::vector<Stand> stands_of(const HexMesh& mesh, const Ground& ground) {
  const VertexStars<QuadId> round = quads_round_vertices(mesh);
  const IdMap<QuadId, QuadSides> sides = quad_sides(mesh);
  std::vector<Stand> stands;
  for (std::size_t i = 0; i < mesh.position.size(); ++i)
    if (!round.of(VertexId(i)).empty()) stands.push_back({VertexId(i), Vec3::Zero(), 0, {}});
  parallel_for(stands.size(), [&](std::size_t i) {
    Stand& stand = stands[i];
    const auto quads = round.of(stand.vertex);
    for (const QuadId q : quads) {
      if (sides[q].front.valid()) return;
      const QuadVertices& v = mesh.quads[q];
      const Vec3 normal = (mesh.position[v[2]] - mesh.position[v[0]]).cross(mesh.position[v[3]] - mesh.position[v[1]]);
      stand.outward += normal.normalized();
      stand.edge += std::sqrt(0.5 * normal.norm()) / static_cast<double>(quads.size());
    }
    stand.outward.normalize();
    stand.closest = ground.closest(mesh.position[stand.vertex]).triangle;
  });
  return stands;
}

// By component: 1 where normals point out of the mesh, -1 where into it, 0 where it is not clear.
std::vector<int> orientations(const std::vector<Stand>& stands, const Surface& surface) {
  std::vector<std::array<std::int64_t, 2>> votes(static_cast<std::size_t>(surface.component_count));
  for (const Stand& s : stands)
    if (s.closest.valid()) {
      const double facing = surface.normal[s.closest].dot(s.outward);
      if (std::abs(facing) > kAgainst) ++votes[static_cast<std::size_t>(surface.component[s.closest])][facing > 0 ? 1 : 0];
    }
  std::vector<int> result;
  for (const auto& [against, along] : votes) {
    const double least = kClear * static_cast<double>(against + along);
    result.push_back(static_cast<double>(along) > least ? 1 : static_cast<double>(against) > least ? -1 : 0);
  }
  return result;
}

}  // namespace

void take_own_side(HexMesh& mesh, const Ground& ground) {
  const Surface& surface = ground.surface();
  const std::vector<Stand> stands = stands_of(mesh, ground);
  const std::vector<int> orientation = orientations(stands, surface);
  const auto facing = [&](TriangleId t, const Vec3& outward) {
    return orientation[static_cast<std::size_t>(surface.component[t])] * surface.normal[t].dot(outward);
  };
  // The first wall of the own side along the way, as a share of it.
  const auto own_wall = [&](const Stand& s, const Vec3& way) -> std::optional<double> {
    double from = 0;
    for (int i = 0; i < kWallsBetween; ++i) {
      const auto hit = ground.first_hit(mesh.position[s.vertex] + from * way, way, 1 - from);
      if (!hit) return {};
      from += hit->s;
      if (facing(hit->triangle, s.outward) > kAgainst) return from;
      from += kHair;
    }
    return {};
  };
  parallel_for(stands.size(), [&](std::size_t i) {
    const Stand& s = stands[i];
    if (!s.closest.valid() || facing(s.closest, s.outward) > -kAgainst) return;
    const Vec3 way = kReach * s.edge * s.outward;
    const auto before = own_wall(s, way), behind = own_wall(s, -way);
    if (!before && !behind) return;
    mesh.position[s.vertex] += before && (!behind || *before <= *behind) ? Vec3(*before * way) : Vec3(-*behind * way);
  });
}

}  // namespace strata
