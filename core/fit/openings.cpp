#include "core/fit/openings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "core/base/parallel.h"

namespace strata {
namespace {

constexpr double kBeyond = 0.5;     // of the local edge: nearer to the opening's border a vertex goes to the border
constexpr double kOnEdge = 1e-9;    // working frame: rounding
constexpr double kIn = 1, kOut = 1.5;  // edges, from the skin: surface that it stands for is met on the way from inside to outside

// An edge of one triangle only. `beyond`: unit, in the triangle's plane, away from it.
struct OpenEdge {
  TriangleId triangle;
  std::array<PointId, 2> ends;
  Vec3 beyond = Vec3::Zero();
};

std::vector<OpenEdge> open_edges(const Surface& surface) {
  std::vector<OpenEdge> edges;
  for (const TriangleId t : surface.triangles.ids())
    for (std::size_t i = 0; i < 3; ++i) {
      if (surface.neighbours[t][i].valid()) continue;
      const PointId a = surface.triangles[t][i], b = surface.triangles[t][(i + 1) % 3];
      const Vec3 along = surface.points[b] - surface.points[a];
      edges.push_back({t, {std::min(a, b), std::max(a, b)}, along.cross(surface.normal[t]).normalized()});
    }
  std::sort(edges.begin(), edges.end(),
            [](const OpenEdge& a, const OpenEdge& b) { return std::tie(a.ends, a.triangle) < std::tie(b.ends, b.triangle); });
  // Edges of three triangles and more have no neighbours either.
  std::vector<OpenEdge> open;
  for (std::size_t i = 0, stop = 0; i < edges.size(); i = stop) {
    while (stop < edges.size() && edges[stop].ends == edges[i].ends) ++stop;
    if (stop == i + 1) open.push_back(edges[i]);
  }
  return open;
}

// Where the surface ends, and which way from there is off it.
class OpenBorder {
 public:
  explicit OpenBorder(const Surface& surface)
      : surface_(surface),
        edges_(open_edges(surface)),
        of_(surface.triangles.size(), {-1, -1, -1}),
        beyond_(surface.points.size(), Vec3::Zero()) {
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      const OpenEdge& edge = edges_[e];
      const auto slot = std::find(of_[edge.triangle].begin(), of_[edge.triangle].end(), -1);
      *slot = static_cast<std::int32_t>(e);
      for (PointId p : edge.ends) beyond_[p] += edge.beyond;
    }
  }

  // How far p is beyond the border, if the place closest to it is on the border; 0 otherwise.
  [[nodiscard]] double distance_beyond(const Vec3& p, const SurfacePoint& closest) const {
    const auto along = [&](const Vec3& way) { return way.squaredNorm() > 0 ? (p - closest.position).dot(way.normalized()) : 0; };
    for (PointId corner : surface_.triangles[closest.triangle])
      if ((surface_.points[corner] - closest.position).norm() < kOnEdge) return along(beyond_[corner]);
    for (const std::int32_t e : of_[closest.triangle]) {
      if (e < 0) continue;
      const OpenEdge& edge = edges_[static_cast<std::size_t>(e)];
      const Vec3 from = surface_.points[edge.ends[0]], way = surface_.points[edge.ends[1]] - from;
      if ((closest.position - from).cross(way).norm() < kOnEdge * way.norm()) return along(edge.beyond);
    }
    return 0;
  }

 private:
  const Surface& surface_;
  std::vector<OpenEdge> edges_;
  IdMap<TriangleId, std::array<std::int32_t, 3>> of_;  // open edges of each triangle, then -1
  IdMap<PointId, Vec3> beyond_;                        // sum over the open edges there
};

// A vertex of the skin: which way out is, and how long edges are there.
struct SkinVertex {
  Vec3 outward = Vec3::Zero();
  double edge = 0;
  int edges = 0;
};
IdMap<VertexId, SkinVertex> skin_vertices(const HexMesh& mesh) {
  IdMap<VertexId, SkinVertex> skin(mesh.position.size());
  for (const QuadVertices& q : mesh.quads) {
    const Vec3 normal = (mesh.position[q[2]] - mesh.position[q[0]]).cross(mesh.position[q[3]] - mesh.position[q[1]]).normalized();
    for (std::size_t k = 0; k < 4; ++k) {
      skin[q[k]].outward += normal;
      for (VertexId v : {q[k], q[(k + 1) & 3]}) {
        skin[v].edge += (mesh.position[q[k]] - mesh.position[q[(k + 1) & 3]]).norm();
        ++skin[v].edges;
      }
    }
  }
  for (SkinVertex& v : skin)
    if (v.edges > 0) v.outward.normalize(), v.edge /= v.edges;
  return skin;
}

}  // namespace

std::vector<TriangleId> triangles_at_openings(const Surface& surface) {
  std::vector<TriangleId> result;
  if (surface.closed) return result;
  for (const OpenEdge& edge : open_edges(surface)) result.push_back(edge.triangle);
  return result;
}

IdMap<VertexId, std::uint8_t> vertices_over_openings(const HexMesh& mesh, const Ground& ground, const Surface& whole) {
  IdMap<VertexId, std::uint8_t> result(mesh.position.size(), 0);
  if (whole.closed) return result;
  const OpenBorder border(whole);
  const Locator locator(whole);
  const IdMap<VertexId, SkinVertex> skin = skin_vertices(mesh);
  parallel_for(mesh.position.size(), [&](std::size_t i) {
    const VertexId v(i);
    const auto& [outward, edge, edges] = skin[v];
    if (edges == 0) return;
    const Vec3& p = mesh.position[v];
    if (border.distance_beyond(p, locator.closest(p)) > kBeyond * edge) {
      result[v] = 1;
      return;
    }
    const Vec3 way = (kIn + kOut) * edge * outward;
    result[v] = ground.first_hit(p - kIn * edge * outward, way, 1) ? 0 : 1;
  });
  return result;
}

}  // namespace strata
