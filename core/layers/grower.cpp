#include "core/layers/grower.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/context.h"
#include "core/layers/facets.h"
#include "core/layers/heal.h"
#include "core/layers/inflate.h"
#include "core/layers/open.h"
#include "core/mesh/adjacency.h"
#include "core/sheets/insert_sheet.h"

namespace strata {
namespace {

constexpr int kMostWidenings = 8;
constexpr double kStep = 0.6;             // of the local size: the way tops go at once
constexpr int kMostSteps = 40;
constexpr int kCatchUps = 6;
constexpr double kThick = 3;              // local sizes: what the rings next to the wall can bear alone (paper section 10)
constexpr double kGapShare = 0.35;        // of the way to the opposite wall, which may want layers too
constexpr double kBareGapShare = 0.5;
constexpr double kStride = 1;             // of the local size: the way that the top of a thick layer goes in one step at most
constexpr int kThickCatchUps = 20;
constexpr double kThicknessSlope = 0.4;   // of layers that are not thick
constexpr double kSlopePerSize = 0.2;     // of thick ones: the thicker, the wider would be what one narrow place thins
constexpr double kMostSlope = 2;
constexpr double kFinalSlope = 2.5;       // times as much between thick columns that stand already
constexpr float kThickAhead = 0.4F;       // in place of kAhead
constexpr double kProgress = 0.95;        // of the way that was left before: when no less is, it ends
constexpr double kRegrowth = 2;           // what a short column tries at once
constexpr double kRegrowthStart = 0.1;    // of its wish, on top
constexpr int kSweeps = 2;                // of the optimiser after a step
constexpr int kLastSweeps = 4;
constexpr double kLeastQuality = 0.12;    // scaled Jacobian that physical layers may cost
constexpr double kGoodQuality = 0.35;     // and that blending may cost
constexpr double kPoorColumns = 0.1;      // scaled Jacobian: hexes under it are polished before they are cut
constexpr double kShort = 0.97;           // of its wish: columns under it draw their neighbours down

constexpr double kNearlyAll = 0.95;       // of the columns must have room when layers are given up

// Is `a` to be given up before `b`? What is not named is not given up.
bool before(const std::vector<GiveUp>& order, GiveUp a, GiveUp b) {
  const auto at = [&](GiveUp what) { return std::find(order.begin(), order.end(), what); };
  return at(a) < at(b);
}

double wish_of(const GrowingSheet& sheet, std::size_t c, Reach reach) {
  return reach == Reach::Full ? sheet.thickness[c] : std::min(sheet.needed[c], sheet.thickness[c]);
}

}  // namespace

Grower::Grower(HexMesh start, LayerPlan planned, const LayerRequest& request, Context& context)
    : mesh(std::move(start)),
      plan(std::move(planned)),
      request_(request),
      context_(context),
      widened_(mesh.quads.size(), -1),
      thick_(request.thickest > kThick),
      slope_(thick_ ? std::clamp(kSlopePerSize * request.thickest, kThicknessSlope, kMostSlope) : kThicknessSlope) {
  for (std::size_t g = 0; g < plan.groups.size(); ++g)
    for (QuadId q : plan.groups[g].beyond) widened_[q.index()] = static_cast<std::int32_t>(g);
  for (QuadId q : plan.bare) widened_[q.index()] = kLeftBare;
}

const LayerSpec& Grower::entry_of(FrontIndex front) const {
  const PatchId patch = request_.ground.features().patch_of_chart[ChartId(front / 2)];
  return request_.entries[static_cast<std::size_t>(request_.wishes[patch].entry)];
}

std::vector<GrowingSheet> Grower::growing() const {
  std::vector<GrowingSheet> result;
  for (const GroupSheet& s : sheets_) result.push_back(s.growing);
  return result;
}

// Bare quads between two runs of the group at a vertex join it (dossier 7.3): each step removes a run.
bool Grower::widen(const std::vector<VertexId>& pinches, std::int32_t group) {
  const VertexStars<QuadId> stars = quads_round_vertices(mesh);
  widened_.resize(mesh.quads.size(), -1);
  bool changed = false;
  for (VertexId v : pinches)
    for (QuadId q : stars.of(v)) {
      const auto owner = [&](FacetSide side) {
        return mesh.chart[q].valid() ? plan.group_of_front[static_cast<std::size_t>(front_of(mesh.chart[q], side))] : -1;
      };
      if (widened_[q.index()] != -1 || owner(FacetSide::Back) >= 0 || owner(FacetSide::Front) >= 0) continue;
      widened_[q.index()] = group;
      changed = true;
    }
  return changed;
}

bool Grower::insert(std::int32_t group) {
  SheetRequest sheet;
  sheet.strip = StripTakes::Inner;
  std::vector<FacetIndex> wall;
  for (int round = 0;; ++round) {
    const Facets facets(mesh);
    wall = wall_of_group(mesh, plan, group, widened_);
    std::erase_if(wall, [&](FacetIndex f) { return !facets.exists(f); });
    if (wall.empty()) return true;
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
    return false;
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
  attach_copies(mesh, inserted.sheet.inner_copy, direction, request_.ground);
  // Borders of groups still to come may have moved onto the copies.
  for (std::size_t g = static_cast<std::size_t>(group) + 1; g < plan.groups.size(); ++g) {
    std::vector<VertexId>& wedge = plan.groups[g].wedge_vertices;
    const std::size_t known = wedge.size();
    for (std::size_t i = 0; i < known; ++i)
      if (const VertexId copy = inserted.sheet.inner_copy[wedge[i]]; copy.valid()) wedge.push_back(copy);
    std::sort(wedge.begin(), wedge.end());
  }
  GroupSheet& fresh = sheets_.emplace_back();
  fresh.group = group;
  fresh.first = inserted.sheet.first_hex;
  fresh.count = sheet.faces.size();
  return true;
}

void Grower::measure_feet(GroupSheet& sheet) const {
  const std::vector<FacetIndex> wall = wall_of_group(mesh, plan, sheet.group, widened_);
  GrowingSheet& g = sheet.growing;
  g.feet = feet_of(mesh, wall, g.columns, request_.ground, request_.entries, request_.wishes);
  // Feet on widened quads only take the law of a neighbour.
  const auto known = std::find_if(g.feet.begin(), g.feet.end(), [](const Foot& f) { return f.front != kNoFront; });
  for (Foot& foot : g.feet) {
    if (foot.front != kNoFront || known == g.feet.end()) continue;
    foot.front = known->front;
    foot.first_height = known->first_height;
    foot.growth = known->growth;
  }
}

// Columns on strips of other sheets stand close to the wall beside, which makes way for them.
void Grower::forget_room_on_strips(GroupSheet& sheet) const {
  std::vector<VertexId> tops;
  for (const GroupSheet& other : sheets_)
    if (&other != &sheet) tops.insert(tops.end(), other.growing.columns.top.begin(), other.growing.columns.top.end());
  std::sort(tops.begin(), tops.end());
  for (std::size_t c = 0; c < sheet.room.size(); ++c)
    if (std::binary_search(tops.begin(), tops.end(), sheet.measured.bottom[c])) sheet.room[c] = std::numeric_limits<double>::infinity();
}

// A thick layer may have half of the gap where the opposite wall wants none.
RoomRules Grower::room_rules() const {
  RoomRules rules;
  rules.along_walls = thick_;
  for (const PatchWish& wish : request_.wishes) rules.gap_share.push_back(thick_ && wish.entry < 0 ? kBareGapShare : kGapShare);
  return rules;
}

// The law of each column and the thickness it leads to.
void Grower::decide_law(GroupSheet& sheet) {
  const LayerGroup& group = plan.groups[static_cast<std::size_t>(sheet.group)];
  const std::vector<FacetIndex> wall = wall_of_group(mesh, plan, sheet.group, widened_);
  GrowingSheet& g = sheet.growing;
  sheet.laws.assign(g.feet.size(), {});
  for (std::size_t c = 0; c < g.feet.size(); ++c) {
    const Foot& foot = g.feet[c];
    ColumnLaw& law = sheet.laws[c];
    law.count = group.count;
    law.growth = foot.growth;
    law.first_height = foot.first_height;
    if (foot.front == kNoFront) continue;
    const LayerSpec& entry = entry_of(foot.front);
    law.give_up_growth_first = before(entry.give_up, GiveUp::Growth, GiveUp::FirstHeight);
  }
  const LayerSpec& entry = entry_of(group.fronts.front());
  sheet.blending = 0;
  if (entry.blending == Blending::Count) sheet.blending = entry.blending_count;
  if (entry.blending == Blending::Auto && !g.feet.empty()) {
    std::vector<int> wished(g.feet.size());
    for (std::size_t c = 0; c < wished.size(); ++c) wished[c] = blending_layers(sheet.laws[c], g.feet[c].size);
    std::nth_element(wished.begin(), wished.begin() + static_cast<std::ptrdiff_t>(wished.size() / 2), wished.end());
    sheet.blending = wished[wished.size() / 2];
  }
  // Wedges take layers in pairs.
  if (!group.wedge_vertices.empty() && (group.count + sheet.blending) % 2 != 0) ++sheet.blending;
  for (ColumnLaw& law : sheet.laws) law.blending = sheet.blending;
  g.beside = columns_beside(mesh, wall, g.columns);
  if (sheet.measured.size() == 0) {
    sheet.measured = g.columns;
    sheet.room = room_at(mesh, g.columns, g.feet, sheet.laws, request_.ground, request_.locator, room_rules());
    forget_room_on_strips(sheet);
    if (give_up_layers(sheet)) return decide_law(sheet);
  }
  g.thickness.resize(g.feet.size());
  for (std::size_t c = 0; c < g.thickness.size(); ++c) {
    g.thickness[c] = wished_thickness(sheet.laws[c], g.feet[c].size);
    if (const std::int32_t known = sheet.measured.find(g.columns.bottom[c]); known >= 0)
      g.thickness[c] = std::min(g.thickness[c], sheet.room[static_cast<std::size_t>(known)]);
  }
  grade(mesh, g.columns, g.beside, slope_, g.thickness);
  g.needed.resize(g.thickness.size());
  g.first.resize(g.thickness.size());
  g.physical.resize(g.thickness.size());
  for (std::size_t c = 0; c < g.needed.size(); ++c) {
    const double least = least_thickness(sheet.laws[c]), fit = std::min(1.0, g.thickness[c] / least);
    g.needed[c] = least * fit;
    g.first[c] = sheet.laws[c].first_height * fit;
    g.physical[c] = sheet.blending > 0 ? physical_thickness(sheet.laws[c]) * fit : std::numeric_limits<double>::infinity();
  }
}

bool Grower::give_up_layers(const GroupSheet& sheet) {
  LayerGroup& group = plan.groups[static_cast<std::size_t>(sheet.group)];
  const LayerSpec& entry = entry_of(group.fronts.front());
  if (!before(entry.give_up, GiveUp::Count, GiveUp::FirstHeight)) return false;
  std::vector<ColumnLaw> laws = sheet.laws;
  if (before(entry.give_up, GiveUp::Growth, GiveUp::Count))
    for (ColumnLaw& law : laws) law.growth = std::min(law.growth, 1.0);
  const int asked = group.count;
  group.count = count_that_fits(laws, sheet.room, std::min(entry.minimum_count, asked), kNearlyAll);
  if (group.count == asked) return false;
  const Surface& surface = request_.ground.surface();
  IdMap<PatchId, Box> box(surface.patch_names.size());
  for (FacetIndex f : wall_of_group(mesh, plan, sheet.group, widened_))
    for (VertexId v : mesh.quads[quad_of(f)]) box[mesh.patch[quad_of(f)]].add(surface.frame.to_input(mesh.position[v]));
  for (PatchId p : box.ids()) {
    if (box[p].empty() || request_.wishes[p].entry < 0) continue;
    Diagnostic d;
    d.reason = Reason::LayersFewer;
    d.severity = Severity::Warning;
    d.patch = surface.patch_names[p];
    d.box = box[p];
    d.values = {{"count", group.count}, {"wished", asked}};
    d.message = "patch \"" + d.patch + "\" has " + std::to_string(group.count) + " of the " + std::to_string(asked) +
                " layers wished: there is no room for more, and the count was to be given up";
    plan.changed.push_back(std::move(d));
  }
  return true;
}

void Grower::open() {
  for (std::size_t s = 0; s < sheets_.size(); ++s) sheets_[s].growing.columns = columns_of_sheet(mesh, sheets_[s].first, sheets_[s].count);
  for (; opened_ < sheets_.size(); ++opened_) {
    GroupSheet& sheet = sheets_[opened_];
    measure_feet(sheet);
    decide_law(sheet);
    Opened opened = open_sheet(std::move(mesh), sheet.growing, request_.ground);
    if (!opened.flat.empty()) opened = untangle_opening(std::move(opened), sheet.growing, request_.ground, context_);
    mesh = std::move(opened.mesh);
  }
}

void Grower::collapse_wedges() {
  for (GroupSheet& s : sheets_) s.growing.columns = columns_of_sheet(mesh, s.first, s.count);
  std::vector<Vanishing> vanishing;
  for (const GroupSheet& s : sheets_)
    vanishing.push_back({&s.growing.columns, &plan.groups[static_cast<std::size_t>(s.group)].wedge_vertices});
  Collapsed collapsed = collapse_columns(std::move(mesh), vanishing);
  mesh = std::move(collapsed.mesh);
  for (std::size_t i = 0; i < sheets_.size(); ++i) {
    sheets_[i].growing.prisms = std::move(collapsed.prisms[i]);
    const std::vector<VertexId>& gone = plan.groups[static_cast<std::size_t>(sheets_[i].group)].wedge_vertices;
    Columns kept;
    const Columns& all = sheets_[i].growing.columns;
    for (std::size_t c = 0; c < all.size(); ++c)
      if (!std::binary_search(gone.begin(), gone.end(), all.bottom[c]))
        kept.bottom.push_back(all.bottom[c]), kept.top.push_back(all.top[c]);
    sheets_[i].growing.columns = std::move(kept);
  }
  for (; opened_ < sheets_.size(); ++opened_) {
    measure_feet(sheets_[opened_]);
    decide_law(sheets_[opened_]);
    Opened opened = open_sheet(std::move(mesh), sheets_[opened_].growing, request_.ground);
    if (!opened.flat.empty()) opened = untangle_opening(std::move(opened), sheets_[opened_].growing, request_.ground, context_);
    mesh = std::move(opened.mesh);
  }
}

void Grower::inflate() {
  const auto remeasure = [&] {
    for (GroupSheet& s : sheets_) {
      measure_feet(s);
      GrowingSheet& g = s.growing;
      if (g.thickness.size() == g.columns.size()) lean_with_edges(mesh, g.columns, g.beside, g.thickness, g.feet);
    }
  };
  // Now that all sheets are in, their columns know all their neighbours.
  remeasure();
  for (GroupSheet& s : sheets_) decide_law(s);
  const Inflation inflation(mesh, growing(), request_.ground, request_.rings, thick_ ? Burden::BySize : Burden::Alike);
  const double stride = thick_ ? kStride : std::numeric_limits<double>::infinity();
  const float ahead = thick_ ? kThickAhead : kAhead;
  const int catch_ups = thick_ ? kThickCatchUps : kCatchUps;
  double left = 0;   // of the ways of the last step
  const auto advance = [&](const Inflation::Step& step) {
    Inflation::Advanced advanced = inflation.advance(std::move(mesh), growing(), step, context_);
    mesh = std::move(advanced.mesh);
    left = advanced.left;
  };
  for (const Reach reach : {Reach::Needed, Reach::Full}) {
    const double floor = reach == Reach::Needed ? kLeastQuality : kGoodQuality;
    const Settle settle = reach == Reach::Needed ? Settle::Along : Settle::Around;
    const double way = inflation.typical_way(mesh, growing(), reach);
    const int steps = std::clamp(static_cast<int>(std::ceil(way / kStep)), 1, kMostSteps);
    for (int i = 0; i < steps; ++i) {
      if (i > 0) remeasure();
      // On its way the volume follows by itself: it settles where tops are held up, and everywhere when they are there or far apart.
      const bool follows = i + 1 < steps && !thick_;
      advance({reach, 1.0 / (steps - i), floor, kSweeps, settle, stride, ahead, follows});
    }
    // Columns that stay short draw their neighbours down, then all grow again together: what was in the way has settled by then.
    double before = std::numeric_limits<double>::infinity();
    for (int i = 0; i < catch_ups && left > 0 && (i < 2 || left < kProgress * before); ++i) {
      before = left;
      remeasure();
      const std::vector<std::vector<double>> wish = hold_back(reach, kRegrowth, slope_);
      advance({reach, 1.0, floor, kSweeps, settle, stride, ahead, true});
      for (std::size_t s = 0; s < sheets_.size(); ++s) sheets_[s].growing.thickness = wish[s];
    }
  }
  remeasure();
  hold_back(Reach::Full, 1.0, thick_ ? kFinalSlope * slope_ : slope_);
  advance({Reach::Full, 1.0, kLeastQuality, kLastSweeps});
  std::vector<VertexId> in_prisms;
  for (const GroupSheet& s : sheets_)
    for (const HexVertices& prism : s.growing.prisms.hexes) in_prisms.insert(in_prisms.end(), prism.begin(), prism.end());
  mesh = heal(std::move(mesh), in_prisms, Soundness::ToBeCut, request_.ground, context_);
  mesh = polish_poorest(std::move(mesh), kPoorColumns, Losses::ToBeHealed, in_prisms, request_.ground, context_);
  mesh = heal(std::move(mesh), in_prisms, Soundness::ToBeCut, request_.ground, context_);
  remeasure();
}

// Lowers the wishes of columns that are short to `growth` of what they have (and a little), and those of their neighbours gradually.
// Returns the wishes before.
std::vector<std::vector<double>> Grower::hold_back(Reach reach, double growth, double slope) {
  std::vector<std::vector<double>> before;
  for (GroupSheet& s : sheets_) {
    GrowingSheet& g = s.growing;
    before.push_back(g.thickness);
    for (std::size_t c = 0; c < g.columns.size(); ++c) {
      const double height = height_of(mesh, g, c), wish = wish_of(g, c, reach);
      if (height < kShort * wish) g.thickness[c] = std::min(g.thickness[c], growth * height + (growth - 1) * kRegrowthStart * wish);
    }
    grade(mesh, g.columns, g.beside, slope, g.thickness);
  }
  return before;
}

}  // namespace strata
