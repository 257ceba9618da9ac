#include "core/layers/grow_layers.h"

#include <algorithm>
#include <array>
#include <optional>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/layers/border_row.h"
#include "core/layers/columns.h"
#include "core/layers/facets.h"
#include "core/layers/inflate.h"
#include "core/layers/plan.h"
#include "core/layers/report.h"
#include "core/layers/size_law.h"
#include "core/layers/slice.h"
#include "core/layers/wall.h"
#include "core/mesh/adjacency.h"
#include "core/quality/quality.h"
#include "core/sheets/insert_sheet.h"

namespace strata {
namespace {

constexpr int kGrowRounds = 8;
constexpr int kSettleRounds = 6;
constexpr int kMostWidenings = 8;
constexpr int kMostAttempts = 8;
constexpr double kThick = 0.3;         // of the local size
constexpr double kThinner = 0.5;
constexpr int kThinnings = 2;          // before a front is left bare

// What earlier attempts taught.
struct Lessons {
  std::vector<std::uint8_t> excluded;  // by front
  std::vector<double> scale;           // of the heights, by front
  std::vector<int> thinned;            // how often, by front
};

struct Request {
  const std::vector<LayerSpec>& entries;
  const IdMap<PatchId, PatchWish>& wishes;
  const Ground& ground;
  const Locator& locator;
  const Lessons& lessons;
  std::size_t allowed;                 // hexes that were not positive before: not the layers' doing
};

// One group's sheet.
struct Sheet {
  std::int32_t group = -1;
  HexId first;
  std::size_t count = 0;
  int blending = -1;                   // -1: not decided yet
  GrowingSheet growing;
  std::vector<ColumnLaw> laws;
  Prisms prisms;
};

// The work of one attempt.
struct Grower {
  HexMesh mesh;
  const Request& request;
  Context& context;
  LayerPlan plan;
  std::vector<std::int32_t> widened;       // group a bare quad was given to, by quad; -1
  std::vector<Sheet> sheets;
  HexId first_sheet_hex;
  std::vector<FrontIndex> failed;          // fronts to treat differently

  void insert(std::int32_t group);
  bool widen(const std::vector<VertexId>& pinches, std::int32_t group);
  void take_columns();
  void measure_feet(Sheet& sheet);
  void collapse_wedges();
  void grow(const std::vector<std::uint8_t>& active, int rounds);
  [[nodiscard]] bool touches_sheets_from(std::size_t first, std::int32_t group) const;
  void lift_from(std::size_t first);            // sheets that were inserted but have no thickness yet
  void lift_measured_from(std::size_t first);   // the same when their columns are known
  [[nodiscard]] bool thick(const std::vector<std::uint8_t>& active) const;
  [[nodiscard]] std::vector<GrowingSheet> growing_sheets() const;
  std::vector<Stack> cut_levels(IdMap<VertexId, double>& fraction) const;
};

// Bare quads between two runs of the group at a vertex join it (dossier 7.3): each step removes a run.
bool Grower::widen(const std::vector<VertexId>& pinches, std::int32_t group) {
  const VertexStars<QuadId> stars = quads_round_vertices(mesh);
  widened.resize(mesh.quads.size(), -1);
  bool changed = false;
  for (VertexId v : pinches)
    for (QuadId q : stars.of(v)) {
      const auto owner = [&](FacetSide side) {
        return mesh.chart[q].valid() ? plan.group_of_front[static_cast<std::size_t>(front_of(mesh.chart[q], side))] : -1;
      };
      if (widened[q.index()] >= 0 || owner(FacetSide::Back) >= 0 || owner(FacetSide::Front) >= 0) continue;
      widened[q.index()] = group;
      changed = true;
    }
  return changed;
}

void Grower::insert(std::int32_t group) {
  SheetRequest sheet;
  sheet.strip = StripTakes::Inner;
  std::vector<FacetIndex> wall;
  for (int round = 0;; ++round) {
    const Facets facets(mesh);
    wall = wall_of_group(mesh, plan, group, widened);
    std::erase_if(wall, [&](FacetIndex f) { return !facets.exists(f); });
    if (wall.empty()) return;
    sheet.inner.assign(mesh.hexes.size(), 1);
    sheet.faces.clear();
    bool interface = false;
    for (FacetIndex f : wall) {
      const FaceNeighbour at = facets.hex_face(f);
      sheet.faces.push_back({at.hex, at.face});
      interface = interface || facets.on_interface(f);
    }
    if (interface) {
      const RegionId region = mesh.region[sheet.faces.front().hex];
      for (HexId h : mesh.hexes.ids()) sheet.inner[h] = mesh.region[h] == region;
      std::erase_if(sheet.faces, [&](const HexFace& f) { return mesh.region[f.hex] != region; });
    }
    const std::vector<VertexId> pinches = pinched_vertices(mesh, sheet);
    if (pinches.empty()) break;
    if (round < kMostWidenings && widen(pinches, group)) continue;
    const VertexStars<QuadId> stars = quads_round_vertices(mesh);
    for (VertexId v : pinches)
      for (QuadId q : stars.of(v))
        for (FacetSide side : {FacetSide::Back, FacetSide::Front})
          if (mesh.chart[q].valid() && plan.group_of_front[static_cast<std::size_t>(front_of(mesh.chart[q], side))] == group)
            failed.push_back(front_of(mesh.chart[q], side));
    if (failed.empty()) failed = plan.groups[static_cast<std::size_t>(group)].fronts;
    return;
  }
  IdMap<VertexId, std::vector<Vec3>> normals(mesh.position.size());
  for (FacetIndex f : wall)
    for (std::size_t i = 0; i < 4; ++i) normals[mesh.quads[quad_of(f)][i]].push_back(inward_normal(mesh, f, i));
  const std::size_t before = mesh.position.size();
  SheetInsertion inserted = insert_sheet(std::move(mesh), sheet);
  mesh = std::move(inserted.mesh);
  IdMap<VertexId, Vec3> direction(before, Vec3::Zero());
  for (VertexId v : inserted.sheet.inner_copy.ids())
    if (v.index() < before && inserted.sheet.inner_copy[v].valid()) direction[v] = most_visible(normals[v]);
  attach_copies(mesh, inserted.sheet.inner_copy, direction, request.ground);
  // Borders of groups still to come may have moved onto the copies.
  for (std::size_t g = static_cast<std::size_t>(group) + 1; g < plan.groups.size(); ++g) {
    std::vector<VertexId>& wedge = plan.groups[g].wedge_vertices;
    const std::size_t known = wedge.size();
    for (std::size_t i = 0; i < known; ++i)
      if (const VertexId copy = inserted.sheet.inner_copy[wedge[i]]; copy.valid()) wedge.push_back(copy);
    std::sort(wedge.begin(), wedge.end());
  }
  if (!first_sheet_hex.valid()) first_sheet_hex = inserted.sheet.first_hex;
  Sheet& fresh = sheets.emplace_back();
  fresh.group = group;
  fresh.first = inserted.sheet.first_hex;
  fresh.count = sheet.faces.size();
}

void Grower::take_columns() {
  for (Sheet& s : sheets) s.growing.columns = columns_of_sheet(mesh, s.first, s.count, first_sheet_hex);
}

void Grower::measure_feet(Sheet& sheet) {
  const LayerGroup& group = plan.groups[static_cast<std::size_t>(sheet.group)];
  const std::vector<FacetIndex> wall = wall_of_group(mesh, plan, sheet.group, widened);
  GrowingSheet& g = sheet.growing;
  g.feet = feet_of(mesh, wall, g.columns, request.ground, request.entries, request.wishes);
  // Feet on widened quads only take the law of a neighbour.
  const auto known = std::find_if(g.feet.begin(), g.feet.end(), [](const Foot& f) { return f.front != kNoFront; });
  sheet.laws.assign(g.feet.size(), {});
  for (std::size_t c = 0; c < g.feet.size(); ++c) {
    Foot& foot = g.feet[c];
    if (foot.front == kNoFront && known != g.feet.end()) {
      foot.front = known->front;
      foot.first_height = known->first_height;
      foot.growth = known->growth;
    }
    ColumnLaw& law = sheet.laws[c];
    law.count = group.count;
    law.growth = foot.growth;
    law.first_height = foot.first_height;
    if (foot.front == kNoFront) continue;
    law.first_height *= request.lessons.scale[static_cast<std::size_t>(foot.front)];
    const PatchId patch = request.ground.features().patch_of_chart[ChartId(foot.front / 2)];
    const LayerSpec& entry = request.entries[static_cast<std::size_t>(request.wishes[patch].entry)];
    law.give_up_growth_first = !entry.give_up.empty() && entry.give_up.front() == GiveUp::Growth;
  }
  if (sheet.blending < 0) {
    const PatchId patch = request.ground.features().patch_of_chart[ChartId(group.fronts.front() / 2)];
    const LayerSpec& entry = request.entries[static_cast<std::size_t>(request.wishes[patch].entry)];
    sheet.blending = 0;
    if (entry.blending == Blending::Count) sheet.blending = entry.blending_count;
    if (entry.blending == Blending::Auto && !g.feet.empty()) {
      std::vector<int> wanted(g.feet.size());
      for (std::size_t c = 0; c < wanted.size(); ++c) wanted[c] = blending_layers(sheet.laws[c], g.feet[c].size);
      std::nth_element(wanted.begin(), wanted.begin() + static_cast<std::ptrdiff_t>(wanted.size() / 2), wanted.end());
      sheet.blending = wanted[wanted.size() / 2];
    }
    // Wedges take layers in pairs.
    if (!group.wedge_vertices.empty() && (group.count + sheet.blending) % 2 != 0) ++sheet.blending;
  }
  for (ColumnLaw& law : sheet.laws) law.blending = sheet.blending;
  g.thickness = thickness_at(mesh, wall, g.columns, g.feet, sheet.laws, request.locator);
  g.needed.resize(g.thickness.size());
  for (std::size_t c = 0; c < g.needed.size(); ++c) g.needed[c] = std::min(least_thickness(sheet.laws[c]), g.thickness[c]);
}

void Grower::collapse_wedges() {
  std::vector<Vanishing> vanishing;
  for (const Sheet& s : sheets) vanishing.push_back({&s.growing.columns, &plan.groups[static_cast<std::size_t>(s.group)].wedge_vertices});
  Collapsed collapsed = collapse_columns(std::move(mesh), vanishing);
  mesh = std::move(collapsed.mesh);
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    sheets[i].prisms = std::move(collapsed.prisms[i]);
    const std::vector<VertexId>& gone = plan.groups[static_cast<std::size_t>(sheets[i].group)].wedge_vertices;
    Columns kept;
    const Columns& all = sheets[i].growing.columns;
    for (std::size_t c = 0; c < all.size(); ++c)
      if (!std::binary_search(gone.begin(), gone.end(), all.bottom[c]))
        kept.bottom.push_back(all.bottom[c]), kept.top.push_back(all.top[c]);
    sheets[i].growing.columns = std::move(kept);
  }
}

bool Grower::touches_sheets_from(std::size_t first, std::int32_t group) const {
  if (first >= sheets.size()) return false;
  IdMap<VertexId, std::uint8_t> on_sheet(mesh.position.size(), 0);
  for (std::size_t s = first; s < sheets.size(); ++s)
    for (std::size_t k = 0; k < sheets[s].count; ++k)
      for (VertexId v : mesh.hexes[HexId(sheets[s].first.index() + k)]) on_sheet[v] = 1;
  for (FacetIndex f : wall_of_group(mesh, plan, group, widened))
    for (VertexId v : mesh.quads[quad_of(f)])
      if (on_sheet[v]) return true;
  return false;
}

void Grower::lift_from(std::size_t first) {
  if (first >= sheets.size()) return;
  take_columns();
  lift_measured_from(first);
}

void Grower::lift_measured_from(std::size_t first) {
  for (Sheet& s : sheets) measure_feet(s);
  std::vector<std::uint8_t> active(sheets.size(), 0);
  for (std::size_t s = first; s < sheets.size(); ++s) {
    mesh = open_sheet(std::move(mesh), sheets[s].growing, request.ground);
    active[s] = 1;
  }
  if (thick(active)) {
    mesh = relax(std::move(mesh), growing_sheets(), active, request.ground, context);
    for (Sheet& s : sheets) measure_feet(s);
  }
  grow(active, kGrowRounds);
}

// Thin sheets need no rearrangement.
bool Grower::thick(const std::vector<std::uint8_t>& active) const {
  for (std::size_t s = 0; s < sheets.size(); ++s)
    for (std::size_t c = 0; active[s] && c < sheets[s].growing.columns.size(); ++c)
      if (sheets[s].growing.thickness[c] > kThick * sheets[s].growing.feet[c].size) return true;
  return false;
}

std::vector<GrowingSheet> Grower::growing_sheets() const {
  std::vector<GrowingSheet> growing;
  for (const Sheet& s : sheets) growing.push_back(s.growing);
  return growing;
}

void Grower::grow(const std::vector<std::uint8_t>& active, int rounds) {
  mesh = inflate(std::move(mesh), growing_sheets(), active, request.ground, rounds, context);
}

std::vector<Stack> Grower::cut_levels(IdMap<VertexId, double>& fraction) const {
  std::vector<Stack> stacks;
  fraction.assign(mesh.position.size(), -1);
  for (const Sheet& s : sheets) {
    Stack& stack = stacks.emplace_back();
    stack.columns = s.growing.columns;
    stack.cells = plan.groups[static_cast<std::size_t>(s.group)].count + s.blending;
    stack.prisms = s.prisms;
    const auto cells = static_cast<std::size_t>(stack.cells);
    stack.level.resize(cells * stack.columns.size());
    for (std::size_t c = 0; c < stack.columns.size(); ++c) {
      const double got = column_fractions(s.laws[c], height_of(mesh, s.growing, c), std::span(stack.level).subspan(c * cells, cells));
      const FrontIndex front = s.growing.feet[c].front;
      fraction[stack.columns.bottom[c]] = got * (front == kNoFront ? 1.0 : request.lessons.scale[static_cast<std::size_t>(front)]);
    }
  }
  return stacks;
}

std::vector<HexId> not_positive(const HexMesh& mesh) {
  std::vector<std::uint8_t> bad(mesh.hexes.size(), 0);
  parallel_for(mesh.hexes.size(), [&](std::size_t h) {
    std::array<Vec3, 8> c;
    for (std::size_t i = 0; i < 8; ++i) c[i] = mesh.position[mesh.hexes[HexId(h)][i]];
    bad[h] = !(corner_scaled_jacobian(c) > 0 && scaled_jacobian(c) > 0);
  });
  std::vector<HexId> result;
  for (std::size_t h = 0; h < bad.size(); ++h)
    if (bad[h]) result.push_back(HexId(h));
  return result;
}

// The fronts nearest to the hexes, hex by hex through shared vertices.
std::vector<FrontIndex> fronts_near(const HexMesh& mesh, const LayerPlan& plan, std::vector<HexId> hexes) {
  constexpr int kFarthest = 40;
  const VertexStars<HexId> stars = hexes_round_vertices(mesh);
  const VertexStars<QuadId> quads = quads_round_vertices(mesh);
  std::vector<std::uint8_t> seen(mesh.hexes.size(), 0);
  for (HexId h : hexes) seen[h.index()] = 1;
  std::vector<FrontIndex> fronts;
  for (int ring = 0; ring < kFarthest && fronts.empty() && !hexes.empty(); ++ring) {
    std::vector<HexId> next;
    for (HexId h : hexes)
      for (VertexId v : mesh.hexes[h]) {
        for (QuadId q : quads.of(v))
          for (FacetSide side : {FacetSide::Back, FacetSide::Front})
            if (mesh.chart[q].valid())
              if (const FrontIndex f = front_of(mesh.chart[q], side); plan.group_of_front[static_cast<std::size_t>(f)] >= 0)
                fronts.push_back(f);
        for (HexId n : stars.of(v))
          if (!seen[n.index()]) seen[n.index()] = 1, next.push_back(n);
      }
    hexes = std::move(next);
  }
  std::sort(fronts.begin(), fronts.end());
  fronts.erase(std::unique(fronts.begin(), fronts.end()), fronts.end());
  return fronts;
}

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

struct Attempt {
  HexMesh mesh;
  LayerPlan plan;
  IdMap<VertexId, double> fraction;
  std::vector<FrontIndex> failed;   // empty: the mesh is valid
};

Attempt attempt(HexMesh mesh, const Request& request, Context& context) {
  Grower grower{std::move(mesh), request, context, {}, {}, {}, {}, {}};
  const Ground& ground = request.ground;
  const auto plan = [&] {
    return plan_layers(grower.mesh, Facets(grower.mesh), request.entries, request.wishes, ground.surface(), ground.features(),
                       request.lessons.excluded);
  };
  grower.plan = plan();
  bool rows_added = false;
  for (const std::vector<FrontIndex>& fronts : grower.plan.want_row)
    if (std::optional<HexMesh> with_row = add_border_row(grower.mesh, fronts, ground, context))
      grower.mesh = std::move(*with_row), rows_added = true;
  if (rows_added) grower.plan = plan();
  Attempt result;
  std::size_t opened = 0;   // sheets before it have their thickness
  for (std::size_t g = 0; g < grower.plan.groups.size(); ++g) {
    context.checkpoint();
    const auto group = static_cast<std::int32_t>(g);
    // Groups that touch grow one after the other, so that the later one finds the walls of the earlier one pushed aside.
    if (grower.plan.groups[g].wedge_vertices.empty() && grower.touches_sheets_from(opened, group))
      grower.lift_from(opened), opened = grower.sheets.size();
    grower.insert(group);
    if (!grower.failed.empty()) {
      result.failed = std::move(grower.failed);
      return result;
    }
    const bool last_plain = g + 1 == grower.plan.groups.size() || !grower.plan.groups[g + 1].wedge_vertices.empty();
    if (last_plain && grower.plan.groups[g].wedge_vertices.empty()) grower.lift_from(opened), opened = grower.sheets.size();
    context.progress(0.7 * static_cast<double>(g + 1) / static_cast<double>(grower.plan.groups.size()),
                     static_cast<std::int64_t>(grower.mesh.hexes.size()));
  }
  if (grower.sheets.empty()) {
    result.mesh = std::move(grower.mesh);
    result.plan = std::move(grower.plan);
    result.fraction.assign(result.mesh.position.size(), -1);
    return result;
  }
  if (opened < grower.sheets.size()) {
    grower.take_columns();
    grower.collapse_wedges();
    grower.lift_measured_from(opened);
  }
  for (Sheet& s : grower.sheets) grower.measure_feet(s);
  grower.grow(std::vector<std::uint8_t>(grower.sheets.size(), 1), kSettleRounds);
  context.progress(0.85, static_cast<std::int64_t>(grower.mesh.hexes.size()));

  std::vector<Stack> stacks = grower.cut_levels(result.fraction);
  result.mesh = slice(std::move(grower.mesh), std::move(stacks), request.ground);
  result.fraction.resize(result.mesh.position.size(), -1);
  result.plan = std::move(grower.plan);
  if (const std::vector<HexId> bad = not_positive(result.mesh); bad.size() > request.allowed) {
    result.failed = fronts_near(result.mesh, result.plan, bad);
    if (result.failed.empty())
      for (const LayerGroup& group : result.plan.groups)
        result.failed.insert(result.failed.end(), group.fronts.begin(), group.fronts.end());
    return result;
  }
  drop_unused_vertices(result.mesh, result.fraction, result.plan);
  return result;
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
  const std::size_t fronts = ground.features().chart_count() * 2;
  Lessons lessons{std::vector<std::uint8_t>(fronts, 0), std::vector<double>(fronts, 1.0), std::vector<int>(fronts, 0)};
  const std::size_t allowed = not_positive(mesh).size();
  for (int round = 0;; ++round) {
    if (round == kMostAttempts) lessons.excluded.assign(fronts, 1);
    Attempt tried = attempt(mesh, {layers, wishes, ground, locator, lessons, allowed}, context);
    if (tried.failed.empty() || round == kMostAttempts) {
      for (Diagnostic& d : tried.plan.changed) context.adjusted(std::move(d));
      result.mesh = std::move(tried.mesh);
      result.patches = report_patches(result.mesh, {&tried.plan, std::move(tried.fraction)}, wishes);
      break;
    }
    for (FrontIndex f : tried.failed) {
      const auto i = static_cast<std::size_t>(f);
      lessons.scale[i] *= kThinner;
      if (++lessons.thinned[i] > kThinnings) lessons.excluded[i] = 1, result.rung = LayersRung::Dropped;
    }
    if (result.rung == LayersRung::Full) result.rung = LayersRung::Thinned;
  }
  for (const PatchLayers& p : result.patches)
    if (result.rung == LayersRung::Full && p.thickness_fraction_mean < 0.95) result.rung = LayersRung::Thinned;
  tell_adjustments(result.mesh, result.patches, lessons.excluded, surface, context);
  return result;
}

}  // namespace strata
