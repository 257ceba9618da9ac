#include "core/finer_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "core/base/parallel.h"
#include "core/fit/fit.h"
#include "core/fit/hidden_stretches.h"
#include "core/fit/point_tree.h"
#include "core/fit/skin.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr double kFiner = 0.5;       // of the local edge
constexpr double kPoor = 0.2;        // scaled Jacobian
constexpr double kEnough = 0.4;      // scaled Jacobian: more is not worth counting
constexpr double kWorthless = 0.02;  // scaled Jacobian
constexpr double kGain = 0.02;       // of it, that counts
constexpr double kLostAtMost = 0.01; // of the length of the curves that count: less is as good as none
constexpr double kMissed = 1.5;      // local edges from the nearest vertex: of a surface that the mesh follows it is well within one
constexpr double kMissedAtMost = 0.001;  // of the area
constexpr double kUseful = 0.05;      // scaled Jacobian, that hexes in thin places have at least, to be worth having
constexpr double kGlaring = 0.02;  // of the area: a mesh that misses so much is not of this surface
constexpr double kLostForPlaces = 0.1;   // of the length of the curves that count
constexpr double kMostSamples = 1e5; // of a triangle
constexpr double kPlastic = 0.7548776662466927;  // 1 / the plastic number: its powers spread points evenly (Roberts 2018, R2 sequence)
constexpr double kShort = 2;         // local edges: shorter curves may go
constexpr double kLong = 8;          // local edges: a curve between two charts so long is no noise
constexpr double kFaint = std::numbers::pi / 3;
constexpr double kApart = 0.35;      // local edges: of curves nearer to each other one would still be lost
constexpr double kShortestStretch = 0.5;  // local edges, that is worth finer cells
constexpr double kBall = 1.5;        // local edges
constexpr double kMoreQuads = 0.35;  // of the mesh's, at most
constexpr double kQuadsPerEdge = 9;  // more, for each edge of a refined curve: three quads beside it become twelve
constexpr double kQuadsPerBall = 27;

double turn_of(const Curve& curve) { return std::abs(std::numbers::pi - curve.dihedral_mean); }

// Whether cells half as large could tell a part of the curve from the others.
bool stands_apart(CurveId c, const std::vector<Vec3>& line, const Ground& ground, double least) {
  const std::size_t half = line.size() / 2;
  const Vec3 p = 0.5 * (line[half] + line[half - 1]);
  for (CurveId other : ground.features().curves.ids())
    if (other != c && (ground.project({Hold::Curve, other.value}, p).position - p).norm() < least) return false;
  return true;
}

class LocalSize {
 public:
  explicit LocalSize(const HexMesh& mesh) : mesh_(mesh), skin_(mesh), tree_(mesh, skin_.vertices()) {}
  [[nodiscard]] double at(const Vec3& p) const { return skin_.size_at(mesh_, tree_.nearest(p)); }

 private:
  const HexMesh& mesh_;
  Skin skin_;
  PointTree tree_;
};

std::vector<Vec3> poor_hexes(const HexMesh& mesh) {
  std::vector<double> worst(mesh.hexes.size());
  parallel_for(worst.size(), [&](std::size_t i) { worst[i] = corner_scaled_jacobian(corners_of(mesh, HexId(i))); });
  std::vector<Vec3> centres;
  for (HexId h : mesh.hexes.ids()) {
    if (worst[h.index()] >= kPoor) continue;
    Vec3 sum = Vec3::Zero();
    for (VertexId v : mesh.hexes[h]) sum += mesh.position[v];
    centres.emplace_back(sum / 8);
  }
  return centres;
}

}  // namespace

IdMap<CurveId, std::uint8_t> curves_that_count(const HexMesh& mesh, const Ground& ground) {
  const LocalSize size(mesh);
  const auto& curves = ground.features().curves;
  IdMap<CurveId, std::uint8_t> counts(curves.size(), std::uint8_t{0});
  for (CurveId c : curves.ids()) {
    const double edges = curves[c].length / size.at(ground.surface().points[curves[c].points.front()]);
    const bool is_sharp = turn_of(curves[c]) >= kFaint || (curves[c].left != curves[c].right && edges >= kLong);
    counts[c] = is_sharp && edges >= kShort ? 1 : 0;
  }
  return counts;
}

namespace {

// Share of the surface's area that no vertex of the skin is near to.
double missed_share(const HexMesh& mesh, const Surface& surface) {
  const Skin skin(mesh);
  const PointTree tree(mesh, skin.vertices());
  std::vector<std::array<double, 2>> areas(surface.triangles.size());  // missed, whole
  parallel_for(
      areas.size(),
      [&](std::size_t i) {
        const auto [a, b, c] = surface.corners(TriangleId(i));
        const double area = 0.5 * (b - a).cross(c - a).norm();
        const double h = skin.size_at(mesh, tree.nearest((a + b + c) / 3));
        const auto samples = static_cast<std::size_t>(std::min(kMostSamples, 1 + area / (h * h)));
        std::size_t missed = 0;
        for (std::size_t k = 0; k < samples; ++k) {
          double u = std::fmod((static_cast<double>(k) + 0.5) * kPlastic, 1.0);
          double v = std::fmod((static_cast<double>(k) + 0.5) * kPlastic * kPlastic, 1.0);
          if (u + v > 1) u = 1 - u, v = 1 - v;
          const Vec3 p = a + u * (b - a) + v * (c - a);
          const VertexId near = tree.nearest(p);
          missed += (mesh.position[near] - p).norm() > kMissed * skin.size_at(mesh, near) ? 1 : 0;
        }
        areas[i] = {area * static_cast<double>(missed) / static_cast<double>(samples), area};
      },
      64);
  double missed = 0, whole = 0;
  for (const auto& [m, w] : areas) missed += m, whole += w;
  return whole > 0 ? missed / whole : 0;
}

}  // namespace

bool Merit::misses_thin_places() const { return missed > kMissedAtMost; }

bool Merit::will_do() const { return lost <= kLostAtMost && worst >= kPoor; }

Merit merit_of(const HexMesh& mesh, const Ground& ground, const IdMap<CurveId, std::uint8_t>& counts) {
  const auto& curves = ground.features().curves;
  const IdMap<CurveId, std::vector<Stretch>> hidden = hidden_stretches(mesh, ground);
  double lost = 0, whole = 0;
  for (CurveId c : curves.ids()) {
    if (counts[c] == 0) continue;
    whole += curves[c].length;
    for (const Stretch& s : hidden[c]) lost += s.to - s.from;
  }
  return {.missed = missed_share(mesh, ground.surface()),
          .lost = whole > 0 ? lost / whole : 0,
          .worst = std::min(kEnough, worst_jacobian(mesh))};
}

bool is_better(const Merit& merit, const Merit& than) {
  if (merit.missed < than.missed - kMissedAtMost)
    return than.missed > kGlaring || (merit.worst >= std::min(than.worst, kUseful) && merit.lost < than.lost + kLostForPlaces);
  if (merit.missed > than.missed + kMissedAtMost) return false;
  if (merit.lost < than.lost - kLostAtMost) return merit.worst >= std::min(than.worst - kGain, kPoor) && merit.worst >= kWorthless;
  return merit.lost <= than.lost + kLostAtMost && merit.worst > than.worst + kGain;
}

FinerPlaces finer_places(const HexMesh& mesh, const Shortfall& shortfall, const Ground& ground,
                         const IdMap<CurveId, std::uint8_t>& counts) {
  FinerPlaces finer;
  const LocalSize size(mesh);
  double quads = kMoreQuads * static_cast<double>(mesh.quads.size());
  std::vector<Vec3> places = poor_hexes(mesh);
  places.insert(places.end(), shortfall.places.begin(), shortfall.places.end());
  // One ball does for hexes side by side.
  for (const Vec3& p : places) {
    const double h = size.at(p);
    const auto covers = [&](const SizeSource& ball) { return (ball.a - p).norm() < 0.5 * ball.radius; };
    if (std::any_of(finer.balls.begin(), finer.balls.end(), covers)) continue;
    quads -= kQuadsPerBall;
    if (quads < 0) return {};
    finer.balls.push_back({.shape = SizeSource::Shape::Sphere, .a = p, .radius = kBall * h, .size = kFiner * h});
  }
  const auto& curves = ground.features().curves;
  const IdMap<CurveId, std::vector<Stretch>> hidden = hidden_stretches(mesh, ground);
  std::vector<CurveId> order;
  for (CurveId c : curves.ids())
    if (counts[c] != 0 && !hidden[c].empty()) order.push_back(c);
  std::sort(order.begin(), order.end(),
            [&](CurveId a, CurveId b) { return std::make_tuple(-turn_of(curves[a]), a) < std::make_tuple(-turn_of(curves[b]), b); });
  for (CurveId c : order)
    for (const Stretch& stretch : hidden[c]) {
      const std::vector<Vec3> line = points_along(stretch, curves[c], ground.surface());
      double h = std::numeric_limits<double>::infinity();
      for (const Vec3& p : line) h = std::min(h, size.at(p));
      const double edges = (stretch.to - stretch.from) / h;
      if (edges < kShortestStretch || !stands_apart(c, line, ground, kApart * h) || kQuadsPerEdge * edges > quads) continue;
      quads -= kQuadsPerEdge * edges;
      for (std::size_t i = 0; i + 1 < line.size(); ++i) finer.segments.push_back({line[i], line[i + 1], kFiner * h});
    }
  return finer;
}

}  // namespace strata
