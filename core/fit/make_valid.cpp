#include <algorithm>
#include <array>
#include <string>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/fit/faint.h"
#include "core/fit/fit.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/part.h"
#include "core/optimise/optimise.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

constexpr int kRounds = 5;          // each gives up more, on a wider ring
constexpr int kFreeingRound = 2;    // from this round on vertices may leave the surface
constexpr int kStayRounds = 6;      // after them: vertices that leave the surface come back only as near as hexes allow
constexpr int kStayRings = 2;       // of hexes round the bad ones, one more each round
constexpr int kApproaches = 4;
constexpr int kApproachHalvings = 5;
constexpr int kSweeps = 20;
constexpr int kRings = 3;           // of vertices round those that are let go, that take part
constexpr int kMargin = 2;          // rings of hexes round them that stay still
constexpr int kPolishRounds = 3;
constexpr double kGoal = 0.4;       // scaled Jacobian of the last polish
constexpr int kLastRounds = 4;
struct Poor {
  double jacobian;   // scaled; hexes below are meant
  std::size_t most;  // of them, that features may go for; more are in the nature of the surface
};
constexpr Poor kPoorest{0.1, 64};                      // for these features on them may go
constexpr std::array kPoor{Poor{0.3, 64}, Poor{kGoal, 32}};  // for these faint ones may
constexpr int kFaintRounds = 4;                        // of giving those up
constexpr double kCalmJacobian = 0.05;
constexpr double kOnSurface = 1e-9;  // working frame: rounding
constexpr double kTouching = 1e-8;   // working frame: two boundary vertices so near are taken for one by whoever reads the mesh
constexpr double kParting = 0.3;     // of the way to the neighbours' centre, to part two vertices that coincide
constexpr double kFar = 0.25;        // of the local edge

// Marks `rings` more rings of hexes.
IdMap<VertexId, std::uint8_t> widened(const HexMesh& mesh, IdMap<VertexId, std::uint8_t> marked, int rings) {
  for (int ring = 0; ring < rings; ++ring) {
    IdMap<VertexId, std::uint8_t> wider = marked;
    for (const HexVertices& hex : mesh.hexes)
      if (std::any_of(hex.begin(), hex.end(), [&](VertexId v) { return marked[v] != 0; }))
        for (VertexId v : hex) wider[v] = 1;
    marked = std::move(wider);
  }
  return marked;
}

Box box_of(const HexMesh& mesh, const std::vector<HexId>& hexes, const Frame& frame) {
  Box box;
  for (HexId h : hexes)
    for (VertexId v : mesh.hexes[h]) box.add(frame.to_input(mesh.position[v]));
  return box;
}

enum class Freedom {
  Slide,    // on the surface, off features
  Leave,    // off the surface, and led back to it
  StayOff,  // led back only as near as hexes stay valid
};

struct Loosened {
  std::int64_t features = 0;   // vertices that left their curve or corner
  std::vector<VertexId> freed; // vertices that may leave the surface
};

Loosened loosen(HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& near, Freedom freedom) {
  Loosened result;
  for (VertexId v : near.ids()) {
    Attachment& attachment = mesh.attachment[v];
    if (near[v] == 0 || attachment.hold == Hold::Free || attachment.hold == Hold::Fixed) continue;
    if (attachment.hold == Hold::Curve || attachment.hold == Hold::Corner) ++result.features;
    attachment = {Hold::Chart, kWholeSurface};
    if (freedom == Freedom::Slide) continue;
    attachment = {Hold::Free, -1};
    result.freed.push_back(v);
  }
  return result;
}

// How far held vertices stand from their geometry, in mean edge lengths of the quads round them.
void measure_distance(const HexMesh& mesh, const Ground& ground, FitResult& result) {
  IdMap<VertexId, double> length(mesh.position.size(), 0);
  IdMap<VertexId, std::int32_t> edges(mesh.position.size(), 0);
  for (const QuadVertices& q : mesh.quads)
    for (std::size_t k = 0; k < 4; ++k) {
      const double l = (mesh.position[q[k]] - mesh.position[q[(k + 1) & 3]]).norm();
      for (VertexId v : {q[k], q[(k + 1) & 3]}) {
        length[v] += l;
        ++edges[v];
      }
    }
  IdMap<VertexId, double> off(mesh.position.size(), 0);
  parallel_for(mesh.position.size(), [&](std::size_t i) {
    const VertexId v(i);
    const Attachment attachment = mesh.attachment[v];
    if (edges[v] == 0 || attachment.hold == Hold::Free || attachment.hold == Hold::Fixed) return;
    const double distance = (ground.project(attachment, mesh.position[v]).position - mesh.position[v]).norm();
    off[v] = distance > kOnSurface ? distance * edges[v] / length[v] : 0;
  });
  for (VertexId v : off.ids()) {
    if (edges[v] > 0) ++result.held;
    if (off[v] > 0) ++result.relaxed;
    if (off[v] > kFar) ++result.far;
    result.worst_off = std::max(result.worst_off, off[v]);
  }
}

// 1 for boundary vertices that stand on another one: the skin touches itself there, though every hex may be positive.
IdMap<VertexId, std::uint8_t> coincident_vertices(const HexMesh& mesh) {
  IdMap<VertexId, std::uint8_t> result(mesh.position.size(), 0);
  IdMap<VertexId, std::uint8_t> on_skin(mesh.position.size(), 0);
  for (const QuadVertices& q : mesh.quads)
    for (VertexId v : q) on_skin[v] = 1;
  std::vector<VertexId> order;
  for (VertexId v : on_skin.ids())
    if (on_skin[v] != 0) order.push_back(v);
  parallel_sort(order.begin(), order.end(), [&](VertexId a, VertexId b) {
    const double xa = mesh.position[a].x(), xb = mesh.position[b].x();
    return xa != xb ? xa < xb : a < b;
  });
  parallel_for(order.size(), [&](std::size_t i) {
    const Vec3& p = mesh.position[order[i]];
    const auto meets = [&](std::size_t j) { return (mesh.position[order[j]] - p).norm() < kTouching; };
    for (std::size_t j = i + 1; j < order.size() && mesh.position[order[j]].x() - p.x() < kTouching; ++j)
      if (meets(j)) result[order[i]] = 1;
    for (std::size_t j = i; j > 0 && p.x() - mesh.position[order[j - 1]].x() < kTouching; --j)
      if (meets(j - 1)) result[order[i]] = 1;
  });
  return result;
}

// Pulls vertices that stand on others (a corner's, say, where their curve ends) a little towards their neighbours on the skin, and lets them
// slide from there. Returns the hexes round them.
std::vector<HexId> part_coincident(HexMesh& mesh) {
  const IdMap<VertexId, std::uint8_t> touching = coincident_vertices(mesh);
  IdMap<VertexId, Vec3> sum(mesh.position.size(), Vec3::Zero());
  IdMap<VertexId, std::int32_t> count(mesh.position.size(), 0);
  for (const QuadVertices& q : mesh.quads)
    for (std::size_t k = 0; k < 4; ++k)
      for (VertexId n : {q[(k + 1) & 3], q[(k + 3) & 3]}) {
        sum[q[k]] += mesh.position[n];
        ++count[q[k]];
      }
  for (VertexId v : touching.ids()) {
    if (touching[v] == 0 || mesh.attachment[v].hold == Hold::Corner) continue;
    mesh.attachment[v] = {Hold::Chart, kWholeSurface};
    mesh.position[v] += kParting * (sum[v] / count[v] - mesh.position[v]);
  }
  std::vector<HexId> round;
  for (HexId h : mesh.hexes.ids())
    for (VertexId v : mesh.hexes[h])
      if (touching[v] != 0) {
        round.push_back(h);
        break;
      }
  return round;
}

// One after the other the vertices go towards the surface, as far as the hexes round each do not get poorer than kCalmJacobian or, if they
// are, than they were.
void approach(HexMesh& mesh, const std::vector<VertexId>& vertices, const Ground& ground) {
  const VertexStars<HexId> star = hexes_round_vertices(mesh);
  const auto poorest = [&](VertexId v) {
    double worst = 1;
    for (HexId h : star.of(v)) {
      const std::array<Vec3, 8> corners = corners_of(mesh, h);
      worst = std::min({worst, corner_scaled_jacobian(corners), scaled_jacobian(corners)});
    }
    return worst;
  };
  for (int i = 0; i < kApproaches; ++i)
    for (VertexId v : vertices) {
      const double needed = std::min(kCalmJacobian, poorest(v));
      const Vec3 from = mesh.position[v], way = ground.project(mesh.attachment[v], from).position - from;
      double share = 1;
      for (int halving = 0; halving <= kApproachHalvings; ++halving, share *= 0.5) {
        mesh.position[v] = from + share * way;
        if (poorest(v) >= needed) break;
        mesh.position[v] = from;
      }
    }
}

// Returns how many vertices left their curve or corner.
std::int64_t free_near(HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& near, const Ground& ground, Freedom freedom, Context& context) {
  const Loosened loosened = loosen(mesh, near, freedom);
  OptimiseRequest request;
  request.ground = &ground;
  request.seeds = &near;
  if (freedom == Freedom::Slide) request.open_skin = OpenSkin::Slides;
  OptimiseOptions options;
  options.sweeps = kSweeps;
  options.rings = kRings;
  options.min_scaled_jacobian = kCalmJacobian;
  mesh = optimise(std::move(mesh), request, options, context).mesh;
  mesh = polish(std::move(mesh), request, kCalmJacobian, kPolishRounds, context, Regard::AnglesAndShape).mesh;
  if (!loosened.freed.empty()) {  // lead them back
    for (VertexId v : loosened.freed) mesh.attachment[v] = {Hold::Chart, kWholeSurface};
    if (freedom == Freedom::StayOff) approach(mesh, loosened.freed, ground);
    else mesh = optimise(std::move(mesh), request, options, context).mesh;
  }
  return loosened.features;
}

// Frees what the marked vertices and those `rings` rings of hexes round them hold, working on their surroundings alone. Returns how many
// features that cost.
std::int64_t free_round(HexMesh& mesh, const IdMap<VertexId, std::uint8_t>& marked, int rings, Freedom freedom, const Ground& ground,
                        Context& context) {
  MeshPart part = cut_part(mesh, marked, rings + kRings + kMargin);
  IdMap<VertexId, std::uint8_t> near(part.mesh.position.size());
  for (VertexId v : near.ids()) near[v] = marked[part.whole[v]];
  const std::int64_t features = free_near(part.mesh, widened(part.mesh, std::move(near), rings), ground, freedom, context);
  put_back(part, mesh);
  return features;
}

// Whether the vertex stands on a crease that turns by little, on a corner that would be no more than a bend without such, or on one where
// no charts meet, as creases that end inside a chart make them; and on no border of a patch.
bool is_on_faint_feature(const Attachment& at, const Features& features) {
  const auto is_inside = [&](CurveId c) { return is_inside_patch(features, features.curves[c]); };
  const auto is_faint = [&](CurveId c) { return turns_little(features.curves[c]); };
  const auto parts_nothing = [&](CurveId c) { return features.curves[c].left == features.curves[c].right; };
  if (at.hold == Hold::Curve) return is_inside(CurveId(at.of)) && is_faint(CurveId(at.of));
  if (at.hold != Hold::Corner) return false;
  const std::vector<CurveId>& curves = features.corners[CornerId(at.of)].curves;
  if (curves.empty() || !std::all_of(curves.begin(), curves.end(), is_inside)) return false;
  const auto faint = std::count_if(curves.begin(), curves.end(), is_faint), others = std::ssize(curves) - faint;
  return (faint > 0 && others <= 2) || std::all_of(curves.begin(), curves.end(), parts_nothing);
}

std::vector<HexId> hexes_below(const HexMesh& mesh, double jacobian) {
  return hexes_where(mesh, [&](const std::array<Vec3, 8>& corners) { return scaled_jacobian(corners) < jacobian; });
}

struct Freed {
  std::int64_t features = 0;  // vertices that left their curve or corner
  bool polished = true;  // since the last of them did
};

// Few hexes that are valid but poor cost the features at them, when fewer are so poor then and none poorer; or only the faint ones of these
// features, when half as many are. Then what was freed is polished once more. Whether any features went.
bool improve(HexMesh& mesh, const Poor& poor, bool faint_only, Freed& freed, const Ground& ground, Context& context) {
  const std::vector<HexId> hexes = hexes_below(mesh, poor.jacobian);
  IdMap<VertexId, std::uint8_t> marked = vertices_of(mesh, hexes);
  if (faint_only)
    for (VertexId v : marked.ids()) marked[v] = marked[v] != 0 && is_on_faint_feature(mesh.attachment[v], ground.features()) ? 1 : 0;
  const bool may_free = hexes.size() < poor.most && std::any_of(marked.begin(), marked.end(), [](std::uint8_t m) { return m != 0; });
  if (freed.polished && !may_free) return false;
  HexMesh better = mesh;
  const std::int64_t now = may_free ? free_round(better, marked, 0, Freedom::Slide, ground, context) : 0;
  if (freed.polished && now == 0) return false;
  OptimiseRequest request;
  request.ground = &ground;
  request.open_skin = OpenSkin::Slides;
  better = polish(std::move(better), request, kGoal, kLastRounds, context, Regard::AnglesAndShape).mesh;
  if (!bad_hexes(better).empty()) return false;
  const std::size_t left = hexes_below(better, poor.jacobian).size();
  const bool pays = (faint_only ? 2 * left <= hexes.size() : left < hexes.size()) && worst_jacobian(better) >= worst_jacobian(mesh);
  if (now > 0 && !pays) return false;
  mesh = std::move(better);
  freed = {freed.features + now, true};
  return now > 0;
}

void improve(HexMesh& mesh, Freed& freed, const Ground& ground, Context& context) {
  improve(mesh, kPoorest, false, freed, ground, context);
  if (worst_jacobian(mesh) < kPoorest.jacobian) return;  // faint features elsewhere would not make the mesh better
  for (const Poor& poor : kPoor) {
    int round = 0;
    while (round < kFaintRounds && improve(mesh, poor, true, freed, ground, context)) ++round;
  }
}

}  // namespace

double worst_jacobian(const HexMesh& mesh) {
  return parallel_reduce(
      mesh.hexes.size(), 1.0, [&](std::size_t i) { return scaled_jacobian(corners_of(mesh, HexId(i))); },
      [](double a, double b) { return std::min(a, b); });
}

std::vector<HexId> bad_hexes(const HexMesh& mesh) {
  return hexes_where(mesh, [](const std::array<Vec3, 8>& corners) { return !(scaled_jacobian(corners) > kLeastJacobian); });
}

FitResult make_valid(HexMesh mesh, const Ground& ground, Context& context) {
  FitResult result;
  std::vector<HexId> bad = bad_hexes(mesh);
  Diagnostic diagnostic;
  diagnostic.reason = Reason::FeatureSoftened;
  diagnostic.severity = Severity::Warning;
  diagnostic.box = box_of(mesh, bad, ground.surface().frame);
  diagnostic.values = {{"hexes", static_cast<double>(bad.size())}};
  for (HexId h : bad) {
    Vec3 sum = Vec3::Zero();
    for (VertexId v : mesh.hexes[h]) sum += mesh.position[v];
    result.places.emplace_back(sum / 8);
  }
  Freed freed;
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<HexId> parted = part_coincident(mesh);
    bad.insert(bad.end(), parted.begin(), parted.end());
    if (bad.empty()) break;
    freed.features +=
        free_round(mesh, vertices_of(mesh, bad), round, round >= kFreeingRound ? Freedom::Leave : Freedom::Slide, ground, context);
    bad = bad_hexes(mesh);
  }
  for (int round = 0; round < kStayRounds && !bad.empty(); ++round) {
    freed.features += free_round(mesh, vertices_of(mesh, bad), kStayRings + round, Freedom::StayOff, ground, context);
    bad = bad_hexes(mesh);
  }
  freed.polished = freed.features == 0;
  if (bad.empty()) improve(mesh, freed, ground, context);
  result.bad = static_cast<std::int64_t>(bad.size());
  if (freed.features > 0) {
    diagnostic.count = freed.features;
    diagnostic.message = std::to_string(freed.features) +
                         " feature vertices were let go, because hexes at them would be inverted or very poor; refine there";
    result.let_go = std::move(diagnostic);
  }
  measure_distance(mesh, ground, result);
  result.mesh = std::move(mesh);
  return result;
}

}  // namespace strata
