#include "core/layers/grow_layers.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/context.h"
#include "core/base/memory.h"
#include "core/layers/band.h"
#include "core/layers/border_row.h"
#include "core/layers/facets.h"
#include "core/layers/grower.h"
#include "core/layers/heal.h"
#include "core/layers/holes.h"
#include "core/layers/plan.h"
#include "core/layers/report.h"

namespace strata {
namespace {

constexpr int kMostAttempts = 4;
constexpr int kMostHoleRounds = 4;
constexpr std::size_t kMostBadPlaces = 1000;   // hexes: more are no matter of places
constexpr int kLeastRings = 6;           // of vertices round the sheets that give way
constexpr int kMostRings = 40;
constexpr double kRingsPerSize = 3;      // more for each local size of thickness
constexpr double kThinnedBelow = 0.95;   // of the wished thickness

void drop_unused_vertices(HexMesh& mesh, IdMap<VertexId, double>& fraction, LayerPlan& plan) {
  IdMap<VertexId, VertexId> to(mesh.position.size());
  for (const HexVertices& hex : mesh.hexes)
    for (VertexId v : hex) to[v] = v;
  VertexId next(std::size_t{0});
  for (VertexId v : to.ids()) {
    if (!to[v].valid()) continue;
    mesh.position[next] = mesh.position[v];
    mesh.attachment[next] = mesh.attachment[v];
    fraction[next] = fraction[v];
    to[v] = next;
    ++next.value;
  }
  mesh.position.resize(next.index());
  mesh.attachment.resize(next.index());
  fraction.resize(next.index());
  for (HexVertices& hex : mesh.hexes)
    for (VertexId& v : hex) v = to[v];
  for (QuadVertices& quad : mesh.quads)
    for (VertexId& v : quad) v = to[v];
  for (LayerGroup& group : plan.groups) {
    for (VertexId& v : group.wedge_vertices) v = to[v];
    std::erase_if(group.wedge_vertices, [](VertexId v) { return !v.valid(); });
    std::sort(group.wedge_vertices.begin(), group.wedge_vertices.end());
  }
}

// Vertices of the walls that are to carry layers, and how many rings of hexes must give way for them.
struct Reachable {
  IdMap<VertexId, std::uint8_t> wall;
  int rings = kLeastRings;
  double thickest = 0;   // over the local size
};
Reachable reach_of(const HexMesh& mesh, const std::vector<LayerSpec>& entries, const IdMap<PatchId, PatchWish>& wishes) {
  Reachable result{IdMap<VertexId, std::uint8_t>(mesh.position.size(), 0)};
  IdMap<PatchId, double> edges(wishes.size(), 0);
  IdMap<PatchId, std::int64_t> quads(wishes.size(), 0);
  for (QuadId q : mesh.quads.ids()) {
    const PatchId patch = mesh.patch[q];
    if (!patch.valid() || wishes[patch].entry < 0) continue;
    for (VertexId v : mesh.quads[q]) result.wall[v] = 1;
    edges[patch] += std::sqrt(area_vector(mesh, mesh.quads[q]).norm());
    ++quads[patch];
  }
  double& thickest = result.thickest;
  for (PatchId p : wishes.ids()) {
    if (quads[p] == 0) continue;
    const double size = entries[static_cast<std::size_t>(wishes[p].entry)].relative ? 1 : edges[p] / static_cast<double>(quads[p]);
    thickest = std::max(thickest, wishes[p].law.total() / size);
  }
  result.rings = std::clamp(kLeastRings + static_cast<int>(std::ceil(kRingsPerSize * (thickest - 1))), kLeastRings, kMostRings);
  return result;
}

Vec3 centre_of(const HexMesh& mesh, HexId h) {
  Vec3 sum = Vec3::Zero();
  for (VertexId v : mesh.hexes[h]) sum += 0.125 * mesh.position[v];
  return sum;
}

struct Attempt {
  HexMesh mesh;
  LayerPlan plan;
  IdMap<VertexId, double> fraction;
  std::vector<FrontIndex> failed;   // empty: the mesh is valid
  std::vector<std::pair<FrontIndex, FrontIndex>> crossed_badly;
  std::vector<Vec3> bad_places;     // middles of hexes that are not valid
};

// The fronts nearest to the hexes: those of hexes' own vertices.
std::vector<FrontIndex> fronts_near(const HexMesh& mesh, const LayerPlan& plan, const std::vector<HexId>& hexes) {
  constexpr int kFarthest = 40;
  const VertexStars<HexId> stars = hexes_round_vertices(mesh);
  const VertexStars<QuadId> quads = quads_round_vertices(mesh);
  std::vector<std::uint8_t> seen(mesh.hexes.size(), 0);
  std::vector<HexId> front = hexes;
  for (HexId h : front) seen[h.index()] = 1;
  std::vector<FrontIndex> fronts;
  for (int ring = 0; ring < kFarthest && fronts.empty() && !front.empty(); ++ring) {
    std::vector<HexId> next;
    for (HexId h : front)
      for (VertexId v : mesh.hexes[h]) {
        for (QuadId q : quads.of(v))
          for (FacetSide side : {FacetSide::Back, FacetSide::Front})
            if (const FrontIndex f = front_of(mesh.chart[q], side); f != kNoFront && plan.group_of_front[static_cast<std::size_t>(f)] >= 0)
              fronts.push_back(f);
        for (HexId n : stars.of(v))
          if (!seen[n.index()]) seen[n.index()] = 1, next.push_back(n);
      }
    front = std::move(next);
  }
  std::sort(fronts.begin(), fronts.end());
  fronts.erase(std::unique(fronts.begin(), fronts.end()), fronts.end());
  return fronts;
}

Attempt attempt(HexMesh mesh, const LayerRequest& request, const PlanLessons& lessons, std::size_t allowed, Context& context) {
  const Ground& ground = request.ground;
  const auto plan = [&] {
    return plan_layers(mesh, JoinedFacets(mesh, lessons.bare), request.entries, request.wishes, ground.surface(), ground.features(),
                       lessons);
  };
  LayerPlan planned = plan();
  bool rows_added = false;
  for (const std::vector<FrontIndex>& fronts : planned.want_row)
    if (std::optional<HexMesh> with_row = add_border_row(mesh, fronts, ground, context)) mesh = std::move(*with_row), rows_added = true;
  if (rows_added) planned = plan();
  Grower grower(std::move(mesh), std::move(planned), request, context);
  Attempt result;
  const auto groups = static_cast<std::int32_t>(grower.plan.groups.size());
  for (std::int32_t g = 0; g < groups; ++g) {
    context.checkpoint();
    if (!grower.insert(g)) {
      result.failed = std::move(grower.failed);
      return result;
    }
    // Each sheet opens before the next goes in, which then finds walls that are sound.
    if (grower.plan.groups[static_cast<std::size_t>(g)].wedge_vertices.empty()) grower.open();
    context.progress(0.3 * (g + 1) / groups, static_cast<std::int64_t>(grower.mesh.hexes.size()));
  }
  if (grower.empty()) {
    result.mesh = std::move(grower.mesh);
    result.plan = std::move(grower.plan);
    result.fraction.assign(result.mesh.position.size(), -1);
    return result;
  }
  grower.collapse_wedges();
  grower.inflate();
  context.progress(0.85, static_cast<std::int64_t>(grower.mesh.hexes.size()));
  return_free_memory();  // the cut mesh is the largest thing of all
  grower.cut();
  result.mesh = std::move(grower.mesh);
  result.plan = std::move(grower.plan);
  result.fraction = std::move(grower.fraction);
  if (const std::vector<HexId> bad = not_positive(result.mesh); bad.size() > allowed) {
    result.crossed_badly = std::move(grower.crossed_badly);
    for (HexId h : bad) result.bad_places.push_back(centre_of(result.mesh, h));
    result.failed = fronts_near(result.mesh, result.plan, bad);
    if (result.failed.empty())
      for (const LayerGroup& group : result.plan.groups)
        result.failed.insert(result.failed.end(), group.fronts.begin(), group.fronts.end());
  }
  return result;
}

// 1: the quad carries layers after the lessons.
IdMap<QuadId, std::uint8_t> wall_quads(const HexMesh& mesh, const IdMap<PatchId, PatchWish>& wishes, const PlanLessons& lessons) {
  IdMap<QuadId, std::uint8_t> wall(mesh.quads.size(), 0);
  for (QuadId q : wall.ids()) {
    if (!mesh.patch[q].valid() || !mesh.chart[q].valid() || wishes[mesh.patch[q]].entry < 0) continue;
    const auto stays_bare = [&](FacetSide side) { return lessons.excluded[static_cast<std::size_t>(front_of(mesh.chart[q], side))] != 0; };
    wall[q] = !(stays_bare(FacetSide::Back) && stays_bare(FacetSide::Front));
  }
  return wall;
}

// Layers cannot run out where groups cross: those that meet at a hole become one.
void join_at_holes(const HexMesh& mesh, const LayerPlan& plan, PlanLessons& lessons) {
  const auto front_with_layers = [&](QuadId q) {
    for (FacetSide side : {FacetSide::Back, FacetSide::Front})
      if (const FrontIndex f = front_of(mesh.chart[q], side); f != kNoFront && plan.group_of_front[static_cast<std::size_t>(f)] >= 0)
        return f;
    return kNoFront;
  };
  const VertexStars<QuadId> stars = quads_round_vertices(mesh);
  for (QuadId q : lessons.bare)
    for (VertexId v : mesh.quads[q])
      for (QuadId beside : stars.of(v)) {
        const FrontIndex a = front_with_layers(q), b = front_with_layers(beside);
        if (a == kNoFront || b == kNoFront) continue;
        if (plan.group_of_front[static_cast<std::size_t>(a)] == plan.group_of_front[static_cast<std::size_t>(b)]) continue;
        const std::pair<FrontIndex, FrontIndex> pair = std::minmax(a, b);
        if (std::find(lessons.joined.begin(), lessons.joined.end(), pair) == lessons.joined.end()) lessons.joined.push_back(pair);
      }
}

// Where few hexes are bad, the wall under them is left out: the lessons name the quads, and a copy of the mesh gets rows for wedges
// round them. False: nothing changed.
bool leave_out(const HexMesh& whole, const std::vector<Vec3>& places, const LayerRequest& request, PlanLessons& lessons,
               std::optional<HexMesh>& with_holes, Context& context) {
  if (places.empty() || places.size() > kMostBadPlaces) return false;
  const IdMap<QuadId, std::uint8_t> wall = wall_quads(whole, request.wishes, lessons);
  std::optional<std::vector<QuadId>> holes = widened_holes(whole, wall, lessons.bare, places);
  if (!holes) return false;
  std::optional<WithHoles> with = with_rows_round(whole, wall, std::move(*holes), request.ground, context);
  if (!with) return false;
  with_holes = std::move(with->mesh);
  lessons.bare = std::move(with->holes);
  return true;
}

}  // namespace

GrowResult grow_layers(HexMesh mesh, const std::vector<LayerSpec>& layers, const Ground& ground, Context& context) {
  GrowResult result;
  const Surface& surface = ground.surface();
  const IdMap<PatchId, PatchWish> wishes = match_patches(layers, surface.patch_names);
  if (std::none_of(wishes.begin(), wishes.end(), [](const PatchWish& w) { return w.entry >= 0; })) {
    result.mesh = std::move(mesh);
    return result;
  }
  const Locator locator(surface);
  const Reachable reach = reach_of(mesh, layers, wishes);
  const LayerRequest request{layers, wishes, ground, locator, reach.rings, reach.thickest};
  Band band = cut_band(std::move(mesh), reach.wall, reach.rings + 1);
  const std::size_t allowed = not_positive(band.mesh).size();
  PlanLessons lessons;
  lessons.excluded.assign(ground.features().chart_count() * 2, 0);
  Attempt tried;
  std::optional<HexMesh> with_holes;
  int hole_rounds = 0;
  for (int round = 0;; ++round) {
    if (round == kMostAttempts) {
      lessons.excluded.assign(lessons.excluded.size(), 1);
      lessons.bare.clear();
      with_holes.reset();
    }
    tried = attempt(with_holes ? *with_holes : band.mesh, request, lessons, allowed, context);
    if (tried.failed.empty() || round == kMostAttempts) break;
    // Groups that cannot cross are joined; only what fails by itself is left bare.
    lessons.joined.insert(lessons.joined.end(), tried.crossed_badly.begin(), tried.crossed_badly.end());
    result.rung = std::max(result.rung, tried.crossed_badly.empty() ? LayersRung::Dropped : LayersRung::Regrouped);
    if (!tried.crossed_badly.empty()) continue;
    if (hole_rounds < kMostHoleRounds && leave_out(band.mesh, tried.bad_places, request, lessons, with_holes, context)) {
      join_at_holes(band.mesh, tried.plan, lessons);
      ++hole_rounds, --round;
      continue;
    }
    for (FrontIndex f : tried.failed) lessons.excluded[static_cast<std::size_t>(f)] = 1;
  }
  for (Diagnostic& d : tried.plan.changed) context.adjusted(std::move(d));
  band.mesh = std::move(tried.mesh);
  IdMap<VertexId, VertexId> in_whole;
  result.mesh = join_band(std::move(band), in_whole);
  IdMap<VertexId, double> fraction(result.mesh.position.size(), -1);
  for (VertexId v : tried.fraction.ids()) fraction[in_whole[v]] = tried.fraction[v];
  for (LayerGroup& group : tried.plan.groups)
    for (VertexId& v : group.wedge_vertices) v = in_whole[v];
  drop_unused_vertices(result.mesh, fraction, tried.plan);
  result.patches = report_patches(result.mesh, {&tried.plan, std::move(fraction)}, wishes);
  for (const PatchLayers& p : result.patches)
    if (result.rung == LayersRung::Full && p.thickness_fraction_mean < kThinnedBelow) result.rung = LayersRung::Thinned;
  tell_adjustments(result.mesh, result.patches, tried.plan, lessons.excluded, surface, context);
  return result;
}

}  // namespace strata
