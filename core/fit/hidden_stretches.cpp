#include "core/fit/hidden_stretches.h"

#include <algorithm>

#include "core/fit/skin.h"

namespace strata {
namespace {

constexpr double kLongest = 2;    // arc length over that of an edge that stands on it: more is a short cut
constexpr double kLastStep = 1.5; // edge lengths from where a path leaves the curve for another to the curve's end

class Cover {
 public:
  Cover(const HexMesh& mesh, const Ground& ground)
      : mesh_(mesh), ground_(ground), features_(ground.features()), arcs_(features_.curves.size()), shown_(features_.curves.size()) {
    for (CurveId c : arcs_.ids()) {
      const std::vector<PointId>& points = features_.curves[c].points;
      arcs_[c].assign(1, 0.0);
      for (std::size_t i = 0; i + 1 < points.size(); ++i)
        arcs_[c].push_back(arcs_[c].back() + (ground.surface().points[points[i + 1]] - ground.surface().points[points[i]]).norm());
    }
  }

  void add(VertexId a, VertexId b) {
    if (!is_on_feature(a) || !is_on_feature(b)) return;
    const Attachment &at = mesh_.attachment[a], &bt = mesh_.attachment[b];
    const double length = (mesh_.position[a] - mesh_.position[b]).norm();
    if (at.hold == Hold::Corner && bt.hold == Hold::Corner) return add_between(CornerId(at.of), CornerId(bt.of), length);
    if (at.hold == Hold::Curve) add_from(a, b, length);
    if (bt.hold == Hold::Curve && bt != at) add_from(b, a, length);
  }

  std::vector<Stretch> hidden(CurveId c) {
    std::vector<Stretch>& shown = shown_[c];
    std::sort(shown.begin(), shown.end(), [](const Stretch& a, const Stretch& b) { return a.from < b.from; });
    std::vector<Stretch> result;
    double up_to = 0;
    for (const Stretch& s : shown) {
      if (s.from > up_to) result.push_back({up_to, s.from});
      up_to = std::max(up_to, s.to);
    }
    if (up_to < features_.curves[c].length) result.push_back({up_to, features_.curves[c].length});
    return result;
  }

 private:
  [[nodiscard]] bool is_on_feature(VertexId v) const {
    return mesh_.attachment[v].hold == Hold::Curve || mesh_.attachment[v].hold == Hold::Corner;
  }
  [[nodiscard]] double arc_at(CurveId c, VertexId v) const {
    const Foothold at = ground_.project({Hold::Curve, c.value}, mesh_.position[v]);
    const auto segment = static_cast<std::size_t>(at.hint);
    return arcs_[c][segment] + (at.position - ground_.surface().points[features_.curves[c].points[segment]]).norm();
  }

  // A curve as short as the edge between its corners.
  void add_between(CornerId a, CornerId b, double length) {
    for (CurveId c : features_.corners[a].curves) {
      const Curve& curve = features_.curves[c];
      const bool joins = (curve.first == a && curve.last == b) || (curve.first == b && curve.last == a);
      if (joins && curve.length <= kLongest * length) shown_[c].push_back({0, curve.length});
    }
  }
  // From a vertex on a curve to one on the same curve, at its end, or beyond.
  void add_from(VertexId a, VertexId b, double length) {
    const CurveId c(mesh_.attachment[a].of);
    const Curve& curve = features_.curves[c];
    const double from = arc_at(c, a), to_start = from, to_end = curve.length - from;
    const Attachment& other = mesh_.attachment[b];
    if (other == mesh_.attachment[a]) return add_along(c, from, arc_at(c, b), kLongest * length);
    if (other.hold == Hold::Corner && (curve.first == CornerId(other.of) || curve.last == CornerId(other.of))) {
      const bool is_start = curve.first == curve.last ? to_start < to_end : curve.first == CornerId(other.of);
      return add_along(c, from, is_start ? 0 : curve.length, kLongest * length);
    }
    if (!curve.closed) add_along(c, from, to_start < to_end ? 0 : curve.length, kLastStep * length);
  }
  void add_along(CurveId c, double a, double b, double most) {
    const double length = features_.curves[c].length, low = std::min(a, b), high = std::max(a, b);
    if (features_.curves[c].closed && high - low > 0.5 * length) {
      if (low + length - high > most) return;
      shown_[c].push_back({0, low});
      shown_[c].push_back({high, length});
    } else if (high - low <= most) {
      shown_[c].push_back({low, high});
    }
  }

  const HexMesh& mesh_;
  const Ground& ground_;
  const Features& features_;
  IdMap<CurveId, std::vector<double>> arcs_;  // length up to each point
  IdMap<CurveId, std::vector<Stretch>> shown_;
};

}  // namespace

IdMap<CurveId, std::vector<Stretch>> hidden_stretches(const HexMesh& mesh, const Ground& ground) {
  Cover cover(mesh, ground);
  const Skin skin(mesh);
  for (const SkinEdge& edge : skin.edges()) cover.add(edge.a, edge.b);
  IdMap<CurveId, std::vector<Stretch>> result(ground.features().curves.size());
  for (CurveId c : result.ids()) result[c] = cover.hidden(c);
  return result;
}

std::vector<Vec3> points_along(const Stretch& stretch, const Curve& curve, const Surface& surface) {
  std::vector<Vec3> result;
  double arc = 0;
  for (std::size_t i = 0; i + (curve.closed ? 0 : 1) < curve.points.size(); ++i) {
    const Vec3 &a = surface.points[curve.points[i]], &b = surface.points[curve.points[(i + 1) % curve.points.size()]];
    const double length = (b - a).norm(), low = std::clamp(stretch.from - arc, 0.0, length),
                 high = std::clamp(stretch.to - arc, 0.0, length);
    if (high > low) {
      if (result.empty()) result.emplace_back(a + low / length * (b - a));
      result.emplace_back(a + high / length * (b - a));
    }
    arc += length;
  }
  return result;
}

}  // namespace strata
