#include "core/optimise/result.h"

#include <algorithm>
#include <utility>

#include "core/base/parallel.h"
#include "core/mesh/adjacency.h"
#include "core/optimise/workspace.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

struct Jacobians {
  double min = 1, sum = 0;
  std::int64_t inverted = 0;
};
Jacobians join(const Jacobians& a, const Jacobians& b) { return {std::min(a.min, b.min), a.sum + b.sum, a.inverted + b.inverted}; }

Jacobians jacobians(const HexMesh& mesh) {
  return parallel_reduce(
      mesh.hexes.size(), Jacobians{},
      [&](std::size_t i) {
        std::array<Vec3, 8> p;
        for (std::size_t c = 0; c < 8; ++c) p[c] = mesh.position[mesh.hexes[HexId(i)][c]];
        const double sj = corner_scaled_jacobian(p);
        return Jacobians{sj, sj, std::int64_t{!(sj > 0)}};
      },
      join);
}

struct Distances {
  double max = 0;
  std::int64_t off = 0;
};

}  // namespace

OptimiseResult summarise(HexMesh mesh, const OptimiseRequest& request, int sweeps) {
  OptimiseResult result;
  const Jacobians j = jacobians(mesh);
  result.min_scaled_jacobian = j.min;
  result.mean_scaled_jacobian = mesh.hexes.empty() ? 0 : j.sum / static_cast<double>(mesh.hexes.size());
  result.inverted = j.inverted;
  result.sweeps = sweeps;
  if (request.ground != nullptr) {
    // The local edge length of a held vertex: the shortest edge there, over its quads.
    IdMap<VertexId, double> edge(mesh.position.size(), std::numeric_limits<double>::infinity());
    for (const QuadVertices& q : mesh.quads)
      for (std::size_t k = 0; k < 4; ++k) {
        const double length = (mesh.position[q[k]] - mesh.position[q[(k + 1) & 3]]).norm();
        for (const VertexId v : {q[k], q[(k + 1) & 3]}) edge[v] = std::min(edge[v], length);
      }
    const Distances d = parallel_reduce(
        mesh.position.size(), Distances{},
        [&](std::size_t i) {
          const VertexId v(i);
          const Attachment a = mesh.attachment[v];
          if (a.hold == Hold::Free || a.hold == Hold::Fixed) return Distances{};
          const double distance = (request.ground->project(a, mesh.position[v]).position - mesh.position[v]).norm();
          return Distances{edge[v] > 0 && edge[v] < 1e300 ? distance / edge[v] : 0, std::int64_t{distance > kOnGround}};
        },
        [](const Distances& a, const Distances& b) { return Distances{std::max(a.max, b.max), a.off + b.off}; });
    result.max_off_ground = d.max;
    result.off_ground = d.off;
  }
  result.mesh = std::move(mesh);
  return result;
}

}  // namespace strata
