#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "core/base/parallel.h"
#include "core/fit/faint.h"
#include "core/fit/fit.h"
#include "core/mesh/adjacency.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kMostBad = 0.5;  // bad hexes at a curve that is not faint, over its vertices: fewer are mended on the spot
constexpr std::int32_t kShort = 12;  // vertices on a crease

// A crease that ends in the open and turns by little may be noise of the triangulation, above all when it is short.
bool may_be_noise(const Curve& curve, std::int32_t vertices, bool poor) {
  return curve.left == curve.right && turns_little(curve) && (poor || vertices <= kShort);
}

// Ascending: what gives way first.
auto strength(const Features& features, CurveId c) {
  const Curve& curve = features.curves[c];
  return std::make_tuple(std::abs(std::numbers::pi - curve.dihedral_mean), curve.length, c);
}

std::vector<double> jacobians(const HexMesh& mesh) {
  std::vector<double> jacobian(mesh.hexes.size());
  parallel_for(jacobian.size(), [&](std::size_t i) { jacobian[i] = scaled_jacobian(corners_of(mesh, HexId(i))); });
  return jacobian;
}

// Curves round hexes that may give way.
class Candidates {
 public:
  Candidates(const HexMesh& mesh, const Features& features, const IdMap<CurveId, std::uint8_t>& let_go)
      : mesh_(mesh), features_(features), let_go_(let_go), star_(hexes_round_vertices(mesh)) {}

  // On the hex's own vertices, or else on those of the hexes round it.
  template <class May>
  const std::vector<CurveId>& near(HexId h, const May& may) {
    found_.clear();
    for (VertexId v : mesh_.hexes[h]) look(v, may);
    if (found_.empty())
      for (VertexId v : mesh_.hexes[h])
        for (HexId n : star_.of(v))
          for (VertexId w : mesh_.hexes[n]) look(w, may);
    std::sort(found_.begin(), found_.end());
    found_.erase(std::unique(found_.begin(), found_.end()), found_.end());
    return found_;
  }

 private:
  template <class May>
  void look(VertexId v, const May& may) {
    const Attachment at = mesh_.attachment[v];
    const auto add = [&](CurveId c) {
      const Curve& curve = features_.curves[c];
      if (!let_go_[c] && is_inside_patch(features_, curve) && may(c)) found_.push_back(c);
    };
    if (at.hold == Hold::Curve) add(CurveId(at.of));
    if (at.hold == Hold::Corner)
      for (CurveId c : features_.corners[CornerId(at.of)].curves) add(c);
  }

  const HexMesh& mesh_;
  const Features& features_;
  const IdMap<CurveId, std::uint8_t>& let_go_;
  VertexStars<HexId> star_;
  std::vector<CurveId> found_;
};

IdMap<CurveId, std::int32_t> vertices_on(const HexMesh& mesh, const Features& features) {
  IdMap<CurveId, std::int32_t> count(features.curves.size(), 0);
  for (const Attachment& at : mesh.attachment)
    if (at.hold == Hold::Curve) ++count[CurveId(at.of)];
  return count;
}

}  // namespace

std::vector<CurveId> creases_in_the_way(const HexMesh& mesh, const Features& features, const IdMap<CurveId, std::uint8_t>& let_go,
                                        GiveWay give_way, const Goals& goals) {
  const std::vector<double> jacobian = jacobians(mesh);
  const IdMap<CurveId, std::int32_t> held = vertices_on(mesh, features);
  Candidates candidates(mesh, features, let_go);
  IdMap<CurveId, std::int32_t> bad(features.curves.size(), 0);  // hexes that would have the curve gone
  std::vector<CurveId> result;
  for (HexId h : mesh.hexes.ids()) {
    const double worst = jacobian[h.index()];
    if (worst > std::max({goals.mediocre, goals.poor, goals.bad})) continue;
    const std::vector<CurveId>& near =
        candidates.near(h, [&](CurveId c) { return worst <= goals.bad || may_be_noise(features.curves[c], held[c], worst <= goals.poor); });
    if (near.empty()) continue;
    const CurveId weakest =
        *std::min_element(near.begin(), near.end(), [&](CurveId a, CurveId b) { return strength(features, a) < strength(features, b); });
    for (CurveId c : near) {
      if (c != weakest && give_way == GiveWay::Weakest) continue;
      if (may_be_noise(features.curves[c], held[c], worst <= goals.poor)) result.push_back(c);
      else ++bad[c];
    }
  }
  for (CurveId c : bad.ids())
    if (bad[c] > kMostBad * held[c]) result.push_back(c);
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

std::vector<CurveId> creases_near(const HexMesh& mesh, const std::vector<HexId>& hexes, const Features& features,
                                  const IdMap<CurveId, std::uint8_t>& let_go) {
  Candidates candidates(mesh, features, let_go);
  std::vector<CurveId> result;
  for (HexId h : hexes) {
    const std::vector<CurveId>& near = candidates.near(h, [](CurveId) { return true; });
    result.insert(result.end(), near.begin(), near.end());
  }
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

}  // namespace strata
