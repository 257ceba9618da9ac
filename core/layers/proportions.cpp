#include "core/layers/proportions.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/mesh/hex.h"

namespace strata {
namespace {

constexpr double kNoLength = 0.0016;  // of the longest axis

}  // namespace

IdMap<HexId, HexTarget> proportions(const HexMesh& mesh) {
  IdMap<HexId, HexTarget> result(mesh.hexes.size());
  parallel_for(mesh.hexes.size(), [&](std::size_t i) {
    const HexVertices& hex = mesh.hexes[HexId(i)];
    std::array<double, 3> length{};
    for (std::size_t e = 0; e < 12; ++e)
      length[e / 4] += 0.25 * (mesh.position[hex[static_cast<std::size_t>(kHexEdges[e][0])]] -
                               mesh.position[hex[static_cast<std::size_t>(kHexEdges[e][1])]])
                                  .norm();
    const double least = kNoLength * *std::max_element(length.begin(), length.end());
    for (std::size_t axis = 0; axis < 3; ++axis) result[HexId(i)][axis] = static_cast<float>(std::max(length[axis], least));
  });
  return result;
}

HexMesh optimise_near(HexMesh mesh, const Neighbourhood& near, const Ground& ground, Context& context) {
  OptimiseRequest request;
  request.ground = &ground;
  request.movable = &near.movable;
  request.seeds = &near.seeds;
  request.targets = &near.targets;
  OptimiseOptions options;
  options.rings = near.rings;
  options.sweeps = near.sweeps;
  options.arrival_sweeps = 0;
  return optimise(std::move(mesh), request, options, context).mesh;
}

}  // namespace strata
