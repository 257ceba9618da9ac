#include "core/layers/plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

#include "core/layers/corner_fan.h"

namespace strata {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kJointBeatsCross = 120 * kDegree;   // sin t = sin t/2
constexpr double kCrossFeasible = 165 * kDegree;     // beyond, a crossing or an imprint has next to no corner left
constexpr double kImprintBest = 135 * kDegree;       // scaled Jacobian sin t = .71
constexpr double kImprintFeasible = 150 * kDegree;
constexpr double kLeastCorner = 0.15;                // scaled Jacobian at a corner of groups that cross: under it they are better joined

struct BorderEdge {
  FacetIndex facet = kNoFacet;   // of the front `from`
  std::int8_t edge = 0;
  FacetIndex other = kNoFacet;
  double angle = 0;
};

// Statistics of all edges between two fronts.
struct FrontPair {
  double length = 0;
  double angle = 0;   // length-weighted sum, then mean
};
using FrontPairs = std::map<std::pair<FrontIndex, FrontIndex>, FrontPair>;

struct DisjointSets {
  std::vector<std::int32_t> parent;
  explicit DisjointSets(std::size_t count) : parent(count) { std::iota(parent.begin(), parent.end(), 0); }
  std::int32_t find(std::int32_t x) {
    while (parent[static_cast<std::size_t>(x)] != x) {
      auto& p = parent[static_cast<std::size_t>(x)];
      p = parent[static_cast<std::size_t>(p)];
      x = p;
    }
    return x;
  }
  // The smaller root stays.
  void join(std::int32_t a, std::int32_t b) {
    a = find(a), b = find(b);
    if (a != b) parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  }
};

struct Planner {
  const HexMesh& mesh;
  const JoinedFacets& facets;
  const std::vector<LayerSpec>& entries;
  const IdMap<PatchId, PatchWish>& wishes;
  const Surface& surface;
  const Features& features;
  const PlanLessons& lessons;

  LayerPlan plan;
  std::vector<std::uint8_t> grows;      // by front
  FrontPairs pairs;
  std::set<QuadId> pushed_onto;         // bare quads that a group has taken

  [[nodiscard]] PatchId patch_of(FrontIndex f) const { return features.patch_of_chart[ChartId(f / 2)]; }
  [[nodiscard]] const std::string& name_of(FrontIndex f) const { return surface.patch_names[patch_of(f)]; }
  [[nodiscard]] const LayerSpec& entry_of(FrontIndex f) const { return entries[static_cast<std::size_t>(wishes[patch_of(f)].entry)]; }
  [[nodiscard]] bool growing(FrontIndex f) const { return f != kNoFront && grows[static_cast<std::size_t>(f)] != 0; }

  void find_growing_fronts();
  void measure_pairs();
  void form_groups();
  void join_at_corners(DisjointSets& sets);
  [[nodiscard]] bool asked_to_cross(const CornerFan& fan) const;
  void order_groups();
  void choose_wedges();
  void wedge_loops_of(std::size_t group, const std::vector<BorderEdge>& border);
  [[nodiscard]] bool push_wedge(std::size_t group);
  void ending_changed(FrontIndex a, FrontIndex b, const std::string& why);
};

void Planner::ending_changed(FrontIndex a, FrontIndex b, const std::string& why) {
  Diagnostic d;
  d.reason = Reason::EndingChanged;
  d.severity = Severity::Warning;
  d.patch = name_of(a);
  d.message = "layers on patch \"" + name_of(a) + "\" towards \"" + (b == kNoFront ? std::string("?") : name_of(b)) + "\": " + why;
  for (const Diagnostic& seen : plan.changed)
    if (seen.message == d.message) return;
  plan.changed.push_back(std::move(d));
}

void Planner::find_growing_fronts() {
  const std::size_t front_count = features.chart_count() * 2;
  grows.assign(front_count, 0);
  plan.group_of_front.assign(front_count, -1);
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f)) continue;
    const FrontIndex front = facets.front(f);
    if (front == kNoFront || grows[static_cast<std::size_t>(front)]) continue;
    if (!lessons.excluded.empty() && lessons.excluded[static_cast<std::size_t>(front)]) continue;
    const PatchWish& wish = wishes[patch_of(front)];
    if (wish.entry < 0 || wish.law.count < 1) continue;
    const std::optional<int>& side = entries[static_cast<std::size_t>(wish.entry)].side;
    if (side && facets.on_interface(f) && mesh.region[facets.hex_face(f).hex].value + 1 != *side) continue;
    grows[static_cast<std::size_t>(front)] = 1;
  }
}

void Planner::measure_pairs() {
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f)) continue;
    const FrontIndex front = facets.front(f);
    if (!growing(front)) continue;
    const QuadVertices q = facets.vertices(f);
    for (int e = 0; e < 4; ++e) {
      const FacetNeighbour n = facets.neighbour(f, e);
      if (n.facet == kNoFacet) continue;
      const FrontIndex other = facets.front(n.facet);
      if (other == front || other == kNoFront) continue;
      // A pair with layers on both sides is seen twice; both halves count alike.
      const double length =
          (mesh.position[q[static_cast<std::size_t>(e)]] - mesh.position[q[static_cast<std::size_t>((e + 1) & 3)]]).norm();
      FrontPair& pair = pairs[{std::min(front, other), std::max(front, other)}];
      pair.length += length;
      pair.angle += length * n.angle;
    }
  }
  for (auto& [key, pair] : pairs) pair.angle = pair.length > 0 ? pair.angle / pair.length : std::numbers::pi;
}

// Correlation clustering, greedy: what was asked first, then the strongest preferences; a front may differ from another only while they
// are in different groups, so a contradiction ends as a regular joint.
void Planner::form_groups() {
  struct Wish {
    FrontIndex a, b;
    bool same, asked;
    double weight;
  };
  std::vector<Wish> order;
  for (const auto& [key, pair] : pairs) {
    const auto [a, b] = key;
    if (!growing(a) || !growing(b)) continue;
    const Ending ab = ending_towards(entry_of(a), name_of(b)), ba = ending_towards(entry_of(b), name_of(a));
    const Meeting m = meeting_of_layers(ab, ba, pair.angle);
    const bool asked_cross = ab == Ending::CrossImprint || ba == Ending::CrossImprint;
    const bool asked = asked_cross || ab == Ending::Regular || ba == Ending::Regular;
    if (asked_cross && m == Meeting::Regular) ending_changed(a, b, "too flat to cross-imprint, joined regularly");
    order.push_back({a, b, m == Meeting::Regular, asked, pair.length * std::abs(pair.angle - kJointBeatsCross)});
  }
  for (const auto& [a, b] : lessons.joined) {
    if (!growing(a) || !growing(b)) continue;
    order.push_back({a, b, true, true, std::numeric_limits<double>::infinity()});
    if (pairs.contains({std::min(a, b), std::max(a, b)}))
      ending_changed(a, b, "joined regularly, because layers that cross would not be valid there");
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const Wish& x, const Wish& y) { return x.asked != y.asked ? x.asked : x.weight > y.weight; });
  DisjointSets sets(grows.size());
  std::set<std::pair<std::int32_t, std::int32_t>> apart;   // fronts that must differ, by wish
  const auto must_differ = [&](std::int32_t ra, std::int32_t rb) {
    return std::any_of(apart.begin(), apart.end(), [&](const auto& p) {
      const auto x = sets.find(p.first), y = sets.find(p.second);
      return (x == ra && y == rb) || (x == rb && y == ra);
    });
  };
  for (const Wish& w : order) {
    const std::int32_t ra = sets.find(w.a), rb = sets.find(w.b);
    if (w.same) {
      if (ra == rb) continue;
      if (must_differ(ra, rb)) {
        ending_changed(w.a, w.b, "cross-imprinted, because a chain of neighbours asks for it");
        apart.insert({w.a, w.b});
      } else {
        sets.join(ra, rb);
      }
    } else if (ra == rb) {
      ending_changed(w.a, w.b, "joined regularly, because a chain of neighbours joins the two");
    } else {
      apart.insert({w.a, w.b});
    }
  }
  join_at_corners(sets);
  std::map<std::int32_t, std::size_t> group_of_root;
  for (FrontIndex f = 0; f < static_cast<FrontIndex>(grows.size()); ++f) {
    if (!growing(f)) continue;
    const auto [at, fresh] = group_of_root.try_emplace(sets.find(f), plan.groups.size());
    if (fresh) plan.groups.emplace_back();
    LayerGroup& group = plan.groups[at->second];
    group.fronts.push_back(f);
    group.count = std::max(group.count, wishes[patch_of(f)].law.count);
  }
}

bool Planner::asked_to_cross(const CornerFan& fan) const {
  for (std::size_t i = 0; i < fan.facet.size(); ++i) {
    const FrontIndex a = facets.front(fan.facet[i]), b = facets.front(fan.facet[(i + 1) % fan.facet.size()]);
    if (a != b && (ending_towards(entry_of(a), name_of(b)) == Ending::CrossImprint ||
                   ending_towards(entry_of(b), name_of(a)) == Ending::CrossImprint))
      return true;
  }
  return false;
}

// Where groups meet round a corner whose edges span no hex the right way round, their crossing has no volume, whatever the angles along
// its edges: at corners with two creases in line, or where convex edges and concave ones alternate. There some groups are joined. What was
// asked to cross is only joined where it has no volume at all.
void Planner::join_at_corners(DisjointSets& sets) {
  std::vector<CornerFan> fans = corner_fans(mesh, facets);
  std::erase_if(fans, [&](const CornerFan& fan) {
    return !std::all_of(fan.facet.begin(), fan.facet.end(), [&](FacetIndex f) { return growing(facets.front(f)); });
  });
  for (bool joined = true; joined;) {
    joined = false;
    for (const CornerFan& fan : fans) {
      std::vector<std::int32_t> group;
      for (FacetIndex f : fan.facet) group.push_back(sets.find(facets.front(f)));
      const double enough = asked_to_cross(fan) ? 0 : kLeastCorner;
      const std::vector<std::int32_t> together =
          corner_quality(fan, group) > enough ? std::vector<std::int32_t>() : better_joined(fan, group);
      for (std::size_t i = 0; !together.empty() && i < group.size(); ++i) {
        const std::size_t next = (i + 1) % group.size();
        const auto among = [&](std::int32_t g) { return std::find(together.begin(), together.end(), g) != together.end(); };
        if (group[i] == group[next] || !among(group[i]) || !among(group[next])) continue;
        ending_changed(facets.front(fan.facet[i]), facets.front(fan.facet[next]),
                       "joined regularly, because layers that cross would have no room at a corner");
      }
      for (std::int32_t g : together) sets.join(together.front(), g), joined = true;
    }
  }
}

// Thick groups first: their strips are wide, so what comes later has room on them. Groups with wedges last: nothing may be inserted
// through a collapsed column.
void Planner::order_groups() {
  std::vector<double> area(grows.size(), 0), edge(grows.size(), 0);
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f) || !growing(facets.front(f))) continue;
    const double a = area_vector(mesh, facets.vertices(f)).norm();
    area[static_cast<std::size_t>(facets.front(f))] += a;
    edge[static_cast<std::size_t>(facets.front(f))] += a * std::sqrt(a);
  }
  for (LayerGroup& group : plan.groups) {
    double weight = 0, sum = 0;
    for (FrontIndex f : group.fronts) {
      const auto i = static_cast<std::size_t>(f);
      const double size = area[i] > 0 ? edge[i] / area[i] : 1;
      const ResolvedLayers& law = wishes[patch_of(f)].law;
      double total = 0, h = law.first_height;
      for (int k = 0; k < law.count; ++k, h *= law.growth) total += h;
      sum += area[i] * (entry_of(f).relative ? total : total / std::max(size, std::numeric_limits<double>::min()));
      weight += area[i];
    }
    group.relative_thickness = weight > 0 ? sum / weight : 0;
  }
  std::stable_sort(plan.groups.begin(), plan.groups.end(), [](const LayerGroup& a, const LayerGroup& b) {
    if (a.wedge_vertices.empty() != b.wedge_vertices.empty()) return a.wedge_vertices.empty();
    return a.relative_thickness > b.relative_thickness;
  });
  for (std::size_t g = 0; g < plan.groups.size(); ++g)
    for (FrontIndex f : plan.groups[g].fronts) plan.group_of_front[static_cast<std::size_t>(f)] = static_cast<std::int32_t>(g);
}

void Planner::choose_wedges() {
  for (std::size_t g = 0; g < plan.groups.size(); ++g)
    for (FrontIndex f : plan.groups[g].fronts) plan.group_of_front[static_cast<std::size_t>(f)] = static_cast<std::int32_t>(g);
  std::vector<std::vector<BorderEdge>> borders(plan.groups.size());
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f) || !growing(facets.front(f))) continue;
    const std::int32_t group = plan.group_of_front[static_cast<std::size_t>(facets.front(f))];
    for (int e = 0; e < 4; ++e) {
      const FacetNeighbour n = facets.neighbour(f, e);
      if (n.facet == kNoFacet) continue;
      const FrontIndex other = facets.front(n.facet);
      if (growing(other) && plan.group_of_front[static_cast<std::size_t>(other)] == group) continue;
      borders[static_cast<std::size_t>(group)].push_back({f, static_cast<std::int8_t>(e), n.facet, n.angle});
    }
  }
  for (std::size_t g = 0; g < plan.groups.size(); ++g) wedge_loops_of(g, borders[g]);
}

// A wedge needs the whole border loop, two quads of the group at each of its vertices, and no crossing on it (dossier 7.3, 7.5).
void Planner::wedge_loops_of(std::size_t group, const std::vector<BorderEdge>& border) {
  if (border.empty()) return;
  const auto ends = [&](const BorderEdge& b) {
    const QuadVertices q = facets.vertices(b.facet);
    return std::pair{q[static_cast<std::size_t>(b.edge)], q[static_cast<std::size_t>((b.edge + 1) & 3)]};
  };
  std::vector<VertexId> vertices;
  for (const BorderEdge& b : border) vertices.push_back(ends(b).first), vertices.push_back(ends(b).second);
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  const auto slot = [&](VertexId v) {
    return static_cast<std::int32_t>(std::lower_bound(vertices.begin(), vertices.end(), v) - vertices.begin());
  };
  DisjointSets loops(vertices.size());
  for (const BorderEdge& b : border) loops.join(slot(ends(b).first), slot(ends(b).second));

  // Quads of the group round each border vertex, and border edges of each quad.
  std::vector<std::int32_t> quads_at(vertices.size(), 0), edges_at(vertices.size(), 0);
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f) || !growing(facets.front(f))) continue;
    if (plan.group_of_front[static_cast<std::size_t>(facets.front(f))] != static_cast<std::int32_t>(group)) continue;
    for (VertexId v : facets.vertices(f))
      if (std::binary_search(vertices.begin(), vertices.end(), v)) ++quads_at[static_cast<std::size_t>(slot(v))];
  }
  std::map<FacetIndex, int> edges_of_facet;
  for (const BorderEdge& b : border) {
    ++edges_of_facet[b.facet];
    ++edges_at[static_cast<std::size_t>(slot(ends(b).first))], ++edges_at[static_cast<std::size_t>(slot(ends(b).second))];
  }

  struct Loop {
    bool wedge_wanted = false, imprint_wanted = false, crossing = false, hole = false, wedge_possible = true, imprint_possible = true;
    double least_angle = 2 * std::numbers::pi;
    FrontIndex from = kNoFront, to = kNoFront;
  };
  std::map<std::int32_t, Loop> loop_of;
  for (const BorderEdge& b : border) {
    Loop& loop = loop_of[loops.find(slot(ends(b).first))];
    const FrontIndex from = facets.front(b.facet), to = facets.front(b.other);
    if (growing(to)) {
      loop.crossing = true;
      continue;
    }
    if (facets.is_bare(b.other)) {
      loop.wedge_wanted = loop.hole = true;
      if (loop.from == kNoFront) loop.from = from;
      if (edges_of_facet[b.facet] != 1) loop.wedge_possible = false;
      continue;
    }
    double angle = b.angle;
    if (to != kNoFront)
      if (const auto at = pairs.find({std::min(from, to), std::max(from, to)}); at != pairs.end()) angle = at->second.angle;
    loop.least_angle = std::min(loop.least_angle, angle);
    const Ending asked = to == kNoFront ? entry_of(from).ending : ending_towards(entry_of(from), name_of(to));
    const Meeting m = meeting_with_bare(asked, angle);
    if (asked == Ending::Imprint && m == Meeting::Wedge) ending_changed(from, to, "too flat to imprint, ended in a wedge if possible");
    (m == Meeting::Wedge ? loop.wedge_wanted : loop.imprint_wanted) = true;
    if (m == Meeting::Wedge || loop.to == kNoFront) loop.from = from, loop.to = to;
    if (angle > kImprintFeasible) loop.imprint_possible = false;
    if (edges_of_facet[b.facet] != 1) loop.wedge_possible = false;
  }
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (quads_at[i] != 2 || edges_at[i] != 2) loop_of[loops.find(static_cast<std::int32_t>(i))].wedge_possible = false;

  std::set<std::int32_t> wedges;
  const Loop* wedged = nullptr;  // the one with the sharpest angle
  bool wants_row = false;
  for (auto& [root, loop] : loop_of) {
    if (!loop.wedge_wanted) continue;
    if (loop.crossing || !loop.wedge_possible) {
      if (!loop.crossing && (loop.hole || !(loop.imprint_wanted && loop.imprint_possible))) wants_row = true;
      ending_changed(loop.from, loop.to, "a wedge does not fit the quads of this border, imprinted instead");
    } else if (loop.imprint_wanted && loop.imprint_possible && !loop.hole) {
      ending_changed(loop.from, loop.to, "one border loop has one ending, imprinted instead of a wedge");
    } else {
      if (loop.imprint_wanted) ending_changed(loop.from, loop.to, "one border loop has one ending, ended in a wedge");
      wedges.insert(root);
      if (!wedged || loop.least_angle < wedged->least_angle) wedged = &loop;
    }
  }
  if (wants_row) plan.want_row.push_back(plan.groups[group].fronts);
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (wedges.contains(loops.find(static_cast<std::int32_t>(i)))) plan.groups[group].wedge_vertices.push_back(vertices[i]);
  if (!wedged || !entry_of(wedged->from).push_wedge) return;
  if (wedged->least_angle < kJointBeatsCross) ending_changed(wedged->from, wedged->to, "too sharp to push the wedge a row away");
  else if (!push_wedge(group))
    ending_changed(wedged->from, wedged->to, "the wedge cannot be pushed a row away on the quads beyond this border");
}

// The group takes the row of bare quads beyond its wedges (paper section 9). Beyond that row the border must be one that wedges can end on:
// two quads of the row at each vertex, and nothing else that grows.
bool Planner::push_wedge(std::size_t group) {
  std::vector<VertexId>& border = plan.groups[group].wedge_vertices;
  const auto in_group = [&](FacetIndex f) {
    return growing(facets.front(f)) && plan.group_of_front[static_cast<std::size_t>(facets.front(f))] == static_cast<std::int32_t>(group);
  };
  const auto at_border = [&](VertexId v) { return std::binary_search(border.begin(), border.end(), v); };
  std::vector<FacetIndex> row;
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f) || in_group(f)) continue;
    const QuadVertices quad = facets.vertices(f);
    if (std::none_of(quad.begin(), quad.end(), at_border)) continue;
    if (facets.front(f) == kNoFront || growing(facets.front(f)) || facets.on_interface(f) || pushed_onto.contains(quad_of(f))) return false;
    row.push_back(f);
  }
  struct Count {
    int quads = 0, edges = 0;
  };
  std::map<VertexId, Count> outer;
  for (FacetIndex f : row) {
    const QuadVertices quad = facets.vertices(f);
    int edges = 0;
    for (int e = 0; e < 4; ++e) {
      const VertexId a = quad[static_cast<std::size_t>(e)], b = quad[static_cast<std::size_t>((e + 1) & 3)];
      if (!at_border(a)) ++outer[a].quads;
      const FacetIndex next = facets.neighbour(f, e).facet;
      if (next == kNoFacet || in_group(next) || std::binary_search(row.begin(), row.end(), next)) continue;
      if (growing(facets.front(next)) || at_border(a) || at_border(b)) return false;
      ++outer[a].edges, ++outer[b].edges, ++edges;
    }
    if (edges != 1) return false;
  }
  if (std::any_of(outer.begin(), outer.end(), [](const auto& v) { return v.second.quads != 2 || v.second.edges != 2; })) return false;
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f) || !growing(facets.front(f))) continue;
    for (VertexId v : facets.vertices(f))
      if (outer.contains(v)) return false;
  }
  border.clear();
  for (const auto& [vertex, count] : outer) border.push_back(vertex);
  for (FacetIndex f : row) plan.groups[group].beyond.push_back(quad_of(f)), pushed_onto.insert(quad_of(f));
  return true;
}

}  // namespace

IdMap<PatchId, PatchWish> match_patches(const std::vector<LayerSpec>& entries, const IdMap<PatchId, std::string>& patch_names) {
  IdMap<PatchId, PatchWish> wishes(patch_names.size());
  for (PatchId p : patch_names.ids())
    for (std::size_t e = 0; e < entries.size() && wishes[p].entry < 0; ++e)
      for (const std::string& pattern : entries[e].patches)
        if (matches(pattern, patch_names[p])) {
          wishes[p] = {static_cast<int>(e), resolve(entries[e], "layers[" + std::to_string(e) + "]")};
          break;
        }
  return wishes;
}

Ending ending_towards(const LayerSpec& entry, const std::string& neighbour) {
  for (const NeighbourEnding& n : entry.neighbours)
    for (const std::string& pattern : n.patches)
      if (matches(pattern, neighbour)) return n.ending;
  return entry.ending;
}

Meeting meeting_of_layers(Ending a, Ending b, double angle) {
  if (a == Ending::CrossImprint || b == Ending::CrossImprint) return angle < kCrossFeasible ? Meeting::CrossImprint : Meeting::Regular;
  if (a == Ending::Regular || b == Ending::Regular) return Meeting::Regular;
  return angle <= kJointBeatsCross ? Meeting::CrossImprint : Meeting::Regular;
}

Meeting meeting_with_bare(Ending asked, double angle) {
  if (asked == Ending::Wedge) return Meeting::Wedge;
  if (asked == Ending::Imprint) return angle <= kImprintFeasible ? Meeting::Imprint : Meeting::Wedge;
  return angle <= kImprintBest ? Meeting::Imprint : Meeting::Wedge;
}

LayerPlan plan_layers(const HexMesh& mesh, const JoinedFacets& facets, const std::vector<LayerSpec>& entries,
                      const IdMap<PatchId, PatchWish>& wishes, const Surface& surface, const Features& features,
                      const PlanLessons& lessons) {
  Planner planner{mesh, facets, entries, wishes, surface, features, lessons, {}, {}, {}, {}};
  planner.find_growing_fronts();
  planner.measure_pairs();
  planner.form_groups();
  planner.choose_wedges();
  planner.order_groups();
  planner.plan.bare = lessons.bare;
  return std::move(planner.plan);
}

}  // namespace strata
