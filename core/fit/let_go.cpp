#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "core/base/parallel.h"
#include "core/fit/fit.h"
#include "core/mesh/adjacency.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kBad = 0.03;    // scaled Jacobian: for hexes below, any crease inside one chart gives way
constexpr double kPoor = 0.30;   // for hexes below, faint ones do
constexpr double kFaint = std::numbers::pi / 3;  // a crease that ends in the open and turns by less is often noise of the triangulation

// Between two charts a curve is a border that the labels of quads rest on: it is not for us.
bool is_crease(const Curve& curve) { return curve.manifold && curve.left.valid() && curve.left == curve.right; }
bool is_faint(const Curve& curve) { return std::abs(std::numbers::pi - curve.dihedral_mean) < kFaint; }

// Ascending: what gives way first.
auto strength(const Features& features, CurveId c) {
  const Curve& curve = features.curves[c];
  return std::make_tuple(std::abs(std::numbers::pi - curve.dihedral_mean), curve.length, c);
}

std::vector<double> corner_jacobians(const HexMesh& mesh) {
  std::vector<double> jacobian(mesh.hexes.size());
  parallel_for(jacobian.size(), [&](std::size_t i) {
    std::array<Vec3, 8> p;
    for (std::size_t c = 0; c < 8; ++c) p[c] = mesh.position[mesh.hexes[HexId(i)][c]];
    jacobian[i] = corner_scaled_jacobian(p);
  });
  return jacobian;
}

}  // namespace

std::vector<CurveId> creases_in_the_way(const HexMesh& mesh, const Features& features, GiveWay give_way) {
  const std::vector<double> jacobian = corner_jacobians(mesh);
  const VertexStars<HexId> star = hexes_round_vertices(mesh);
  std::vector<CurveId> result, candidates;
  const auto look = [&](VertexId v, double worst) {
    const Attachment at = mesh.attachment[v];
    const auto add = [&](CurveId c) {
      const Curve& curve = features.curves[c];
      if (is_crease(curve) && (worst <= kBad || is_faint(curve))) candidates.push_back(c);
    };
    if (at.hold == Hold::Curve) add(CurveId(at.of));
    if (at.hold == Hold::Corner)
      for (CurveId c : features.corners[CornerId(at.of)].curves) add(c);
  };
  for (HexId h : mesh.hexes.ids()) {
    const double worst = jacobian[h.index()];
    if (worst > kPoor) continue;
    candidates.clear();
    for (VertexId v : mesh.hexes[h]) look(v, worst);
    if (candidates.empty())
      for (VertexId v : mesh.hexes[h])
        for (HexId n : star.of(v))
          for (VertexId w : mesh.hexes[n]) look(w, worst);
    if (candidates.empty()) continue;
    if (give_way == GiveWay::All) result.insert(result.end(), candidates.begin(), candidates.end());
    else
      result.push_back(*std::min_element(candidates.begin(), candidates.end(),
                                         [&](CurveId a, CurveId b) { return strength(features, a) < strength(features, b); }));
  }
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

}  // namespace strata
