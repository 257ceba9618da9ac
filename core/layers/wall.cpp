#include "core/layers/wall.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/base/parallel.h"

namespace strata {
namespace {

constexpr double kGoodVisibility = 0.7;   // the mean of the normals serves while no normal turns further than 45 degrees from it
constexpr double kMostStretch = 2;        // longer columns would cross their neighbours before they gain height
constexpr double kSteep = 0.3;            // of a facet's normal in a chart's plane: less says little of a direction there
constexpr double kEdgeStretch = 1.05;     // columns longer than their height by more stand on an edge
constexpr int kLeanSweeps = 12;
constexpr double kLeanDecay = 0.95;
constexpr double kLeastLean = 0.02;       // of the thickness: less is not worth leaving the normal
constexpr double kRayStart = 1e-3;        // of the local size: off the own wall
constexpr double kOwnWall = 0.5;          // of the local size: nearer hits may be the own wall
constexpr int kMostOwnWalls = 4;
constexpr double kStripShare = 0.75;      // of what columns slide on, from the wall to its far end: the rest is for its own quads
constexpr int kStripSteps = 8;
constexpr double kOnStrip = 0.7;          // of the way asked for: nearer places are the far end
constexpr int kSlopeSweeps = 60;

// The side of the facet's quad that is seen: +1 when the quad's own normal points in.
double sense(FacetIndex facet) { return side_of(facet) == FacetSide::Front ? 1.0 : -1.0; }

}  // namespace

std::vector<FacetIndex> wall_of_group(const HexMesh& mesh, const LayerPlan& plan, std::int32_t group,
                                      const std::vector<std::int32_t>& widened) {
  std::vector<FacetIndex> wall;
  for (QuadId q : mesh.quads.ids()) {
    if (q.index() < widened.size() && widened[q.index()] == group) wall.push_back(facet_of(q, FacetSide::Back));
    if (!mesh.chart[q].valid() || (q.index() < widened.size() && widened[q.index()] == kLeftBare)) continue;
    for (FacetSide side : {FacetSide::Back, FacetSide::Front})
      if (plan.group_of_front[static_cast<std::size_t>(front_of(mesh.chart[q], side))] == group) wall.push_back(facet_of(q, side));
  }
  return wall;
}

Vec3 inward_normal(const HexMesh& mesh, FacetIndex facet, std::size_t corner) {
  const QuadVertices& q = mesh.quads[quad_of(facet)];
  const Vec3 p = mesh.position[q[corner]];
  const Vec3 n = (mesh.position[q[(corner + 1) & 3]] - p).cross(mesh.position[q[(corner + 3) & 3]] - p);
  const double length = n.norm();
  return length > 0 ? Vec3(n * (sense(facet) / length)) : Vec3(Vec3::Zero());
}

Vec3 most_visible(const std::vector<Vec3>& normals) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& n : normals) mean += n;
  const auto least = [&](const Vec3& d) {
    double dot = 1;
    for (const Vec3& n : normals) dot = std::min(dot, n.dot(d));
    return dot;
  };
  if (mean.norm() > 0 && least(mean.normalized()) >= kGoodVisibility) return mean.normalized();
  // Centre of the smallest ball round the normals, by Badoiu and Clarkson's steps towards the farthest.
  Vec3 centre = mean / static_cast<double>(std::max<std::size_t>(normals.size(), 1));
  for (int i = 1; i <= 200; ++i) {
    const auto far = std::max_element(normals.begin(), normals.end(), [&](const Vec3& a, const Vec3& b) {
      return (a - centre).squaredNorm() < (b - centre).squaredNorm();
    });
    if (far == normals.end()) break;
    centre += (*far - centre) / (i + 1);
  }
  return centre.norm() > 0 ? Vec3(centre.normalized()) : mean;
}

namespace {

// An edge of the wall at a column's foot, with the facet it belongs to.
struct Spoke {
  VertexId end;
  FacetIndex facet;
  std::size_t corner;
};

// A corner of the wall at a column's foot; ordered by column, then facet, then corner.
struct At {
  std::int32_t column;
  FacetIndex facet;
  std::int32_t corner;
  friend auto operator<=>(const At&, const At&) = default;
};

// The direction of a column that slides on a chart: in its plane, seen well from the facets and from the strips beside, which lie in the
// plane too and end at the border edges of the wall.
Vec3 along_chart(const HexMesh& mesh, VertexId foot, const Vec3& chart_normal, const Vec3& wished, const std::vector<Vec3>& normals,
                 const std::vector<Spoke>& spokes) {
  const auto in_plane = [&](const Vec3& v) { return Vec3(v - chart_normal * chart_normal.dot(v)); };
  std::vector<Vec3> sides;
  for (const Spoke& s : spokes) {
    const auto same = [&](const Spoke& t) { return t.end == s.end; };
    if (std::count_if(spokes.begin(), spokes.end(), same) != 1) continue;
    Vec3 across = chart_normal.cross(mesh.position[s.end] - mesh.position[foot]);
    if (across.dot(inward_normal(mesh, s.facet, s.corner)) < 0) across = -across;
    if (across.norm() > 0) sides.push_back(across.normalized());
  }
  if (sides.empty()) return in_plane(wished);
  for (const Vec3& n : normals)
    if (const Vec3 p = in_plane(n); p.norm() > kSteep) sides.push_back(p.normalized());
  const Vec3 seen = in_plane(most_visible(sides));
  return seen.norm() > 0 ? seen : in_plane(wished);
}

}  // namespace

std::vector<Foot> feet_of(const HexMesh& mesh, const std::vector<FacetIndex>& wall, const Columns& columns, const Ground& ground,
                          const std::vector<LayerSpec>& entries, const IdMap<PatchId, PatchWish>& wishes) {
  const std::size_t count = columns.size();
  std::vector<Foot> feet(count);
  std::vector<At> at;
  for (FacetIndex f : wall)
    for (std::size_t i = 0; i < 4; ++i)
      if (const std::int32_t c = columns.find(mesh.quads[quad_of(f)][i]); c >= 0) at.push_back({c, f, static_cast<std::int32_t>(i)});
  parallel_sort(at.begin(), at.end());
  std::vector<std::size_t> first;   // of each column that stands on the wall
  for (std::size_t i = 0; i < at.size(); ++i)
    if (i == 0 || at[i].column != at[i - 1].column) first.push_back(i);
  const std::size_t standing = first.size();
  first.push_back(at.size());
  parallel_blocks(standing, [&](std::size_t begin, std::size_t end) {
    std::vector<Vec3> normals;
    std::vector<Spoke> spokes;
    for (std::size_t s = begin; s < end; ++s) {
      const std::size_t i = first[s];
      const auto c = static_cast<std::size_t>(at[i].column);
      Foot& foot = feet[c];
      normals.clear();
      spokes.clear();
      double log_height = 0, growth = 0;
      int laws = 0, relatives = 0, edges = 0;
      for (std::size_t j = i; j < first[s + 1]; ++j) {
        const QuadVertices& q = mesh.quads[quad_of(at[j].facet)];
        const auto k = static_cast<std::size_t>(at[j].corner);
        if (const Vec3 n = inward_normal(mesh, at[j].facet, k); n.squaredNorm() > 0) normals.push_back(n);
        for (const std::size_t e : {(k + 1) & 3, (k + 3) & 3}) spokes.push_back({q[e], at[j].facet, k});
        // All four edges: a strip quad's short side alone would mislead.
        for (std::size_t e = 0; e < 4; ++e, ++edges) foot.size += (mesh.position[q[e]] - mesh.position[q[(e + 1) & 3]]).norm();
        const PatchWish& wish = wishes[mesh.patch[quad_of(at[j].facet)]];
        if (wish.entry < 0) continue;
        foot.front = front_of(mesh.chart[quad_of(at[j].facet)], side_of(at[j].facet));
        const bool relative = entries[static_cast<std::size_t>(wish.entry)].relative;
        log_height += std::log(wish.law.first_height);
        growth += wish.law.growth;
        relatives += relative, ++laws;
      }
      foot.size /= std::max(edges, 1);
      if (laws > 0) {
        // Geometric mean where patches meet; relative heights are in units of the size.
        foot.first_height = std::exp((log_height + relatives * std::log(foot.size)) / laws);
        foot.growth = growth / laws;
      }
      foot.direction = most_visible(normals);
      const Foothold own = ground.project({Hold::Chart, mesh.chart[quad_of(at[i].facet)].value}, mesh.position[columns.bottom[c]]);
      foot.own_sense = own.direction.dot(foot.direction) > 0 ? 1 : -1;
      for (const Vec3& n : normals) foot.normal += n / static_cast<double>(normals.size());
      const Attachment& held = mesh.attachment[columns.top[c]];
      if (held.hold == Hold::Chart || held.hold == Hold::Curve) {
        const Vec3 d = ground.project(held, mesh.position[columns.bottom[c]]).direction;
        const Vec3 along = held.hold == Hold::Chart ? along_chart(mesh, columns.bottom[c], d, foot.direction, normals, spokes)
                                                    : Vec3(d * d.dot(foot.direction));
        if (along.norm() > 0) foot.direction = along.normalized();
      }
      const double cosine = normals.empty() ? 1 : foot.normal.dot(foot.direction);
      foot.stretch = 1 / std::max(cosine, 1 / kMostStretch);
    }
  });
  return feet;
}

// Along the column's direction. A vertex of the wall may lie a little behind the surface, which is then hit first: from behind, as the wall
// itself is seen, and near. The way counts from `from`.
std::optional<Locator::Hit> hit_on_opposite_wall(const Vec3& from, const Foot& foot, double limit, const Surface& surface,
                                                 const Locator& locator) {
  double begin = 0;
  for (int i = 0; i < kMostOwnWalls && begin < limit; ++i) {
    const auto hit = locator.first_hit(from + begin * foot.direction, foot.direction, limit - begin);
    if (!hit) return std::nullopt;
    const double way = begin + hit->s;
    const auto& t = surface.triangles[hit->triangle];
    const Vec3 normal = (surface.points[t[1]] - surface.points[t[0]]).cross(surface.points[t[2]] - surface.points[t[0]]);
    if (way > kOwnWall * foot.size || normal.dot(foot.direction) * foot.own_sense <= 0) return Locator::Hit{way, hit->triangle};
    begin = way + kRayStart * foot.size;
  }
  return std::nullopt;
}

// Along what the column slides on, to its far end.
std::optional<double> way_along(const Ground& ground, const Attachment& held, const Vec3& from, const Vec3& direction, double limit) {
  for (int i = 1; i <= kStripSteps; ++i) {
    const double asked = limit * i / kStripSteps;
    const double way = (ground.project(held, from + asked * direction).position - from).norm();
    if (way < kOnStrip * asked) return way;
  }
  return std::nullopt;
}

std::vector<double> room_at(const HexMesh& mesh, const Columns& columns, const std::vector<Foot>& feet, const std::vector<ColumnLaw>& laws,
                            const Ground& ground, const Locator& locator, const RoomRules& rules) {
  const double least_share = *std::min_element(rules.gap_share.begin(), rules.gap_share.end());
  std::vector<double> room(columns.size(), std::numeric_limits<double>::infinity());
  parallel_for(
      columns.size(),
      [&](std::size_t c) {
        const Attachment& held = mesh.attachment[columns.top[c]];
        const Vec3& foot = mesh.position[columns.bottom[c]];
        const double wished = wished_thickness(laws[c], feet[c].size) * feet[c].stretch;
        if (held.hold != Hold::Free) {  // a ray along the surface hits it
          const bool slides = held.hold == Hold::Chart || held.hold == Hold::Curve;
          if (!rules.along_walls || !slides) return;
          if (const auto way = way_along(ground, held, foot, feet[c].direction, wished / kStripShare))
            room[c] = std::max(*way * kStripShare / feet[c].stretch, kRayStart * feet[c].size);
          return;
        }
        const Vec3 from = foot + feet[c].direction * (kRayStart * feet[c].size);
        const Surface& surface = ground.surface();
        const auto opposite = hit_on_opposite_wall(from, feet[c], wished / least_share, surface, locator);
        if (!opposite) return;
        const double share = rules.gap_share[surface.patch[opposite->triangle]];
        room[c] = std::max(opposite->s * share / feet[c].stretch, kRayStart * feet[c].size);
      },
      256);
  return room;
}

std::vector<std::array<std::int32_t, 2>> columns_beside(const HexMesh& mesh, const std::vector<FacetIndex>& wall, const Columns& columns) {
  std::vector<std::array<std::int32_t, 2>> beside;
  for (FacetIndex f : wall) {
    const QuadVertices& q = mesh.quads[quad_of(f)];
    for (std::size_t e = 0; e < 4; ++e) {
      const std::int32_t a = columns.find(q[e]), b = columns.find(q[(e + 1) & 3]);
      if (a >= 0 && b >= 0) beside.push_back({std::min(a, b), std::max(a, b)});
    }
  }
  std::sort(beside.begin(), beside.end());
  beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
  return beside;
}

void grade(const HexMesh& mesh, const Columns& columns, const std::vector<std::array<std::int32_t, 2>>& beside, double slope,
           std::vector<double>& thickness) {
  for (int sweep = 0; sweep < kSlopeSweeps; ++sweep) {
    bool changed = false;
    for (const auto& [a, b] : beside) {
      const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b);
      const double most = slope * (mesh.position[columns.bottom[i]] - mesh.position[columns.bottom[j]]).norm();
      double &ti = thickness[i], &tj = thickness[j];
      if (ti > tj + most) ti = tj + most, changed = true;
      if (tj > ti + most) tj = ti + most, changed = true;
    }
    if (!changed) break;
  }
}

void lean_with_edges(const HexMesh& mesh, const Columns& columns, const std::vector<std::array<std::int32_t, 2>>& beside,
                     const std::vector<double>& thickness, std::vector<Foot>& feet) {
  const std::size_t count = columns.size();
  std::vector<std::uint8_t> edge(count, 0), leans(count, 0);
  for (std::size_t c = 0; c < count; ++c) {
    const bool free = mesh.attachment[columns.top[c]].hold == Hold::Free;
    edge[c] = free && feet[c].stretch > kEdgeStretch;
    leans[c] = free && !edge[c];
  }
  if (std::find(edge.begin(), edge.end(), 1) == edge.end()) return;
  const auto top_offset = [&](std::size_t c) { return Vec3(feet[c].direction * (feet[c].stretch * thickness[c])); };
  std::vector<Vec3> lean(count, Vec3::Zero()), sum(count);
  std::vector<int> neighbours(count);
  for (int sweep = 0; sweep < kLeanSweeps; ++sweep) {
    std::fill(sum.begin(), sum.end(), Vec3::Zero());
    std::fill(neighbours.begin(), neighbours.end(), 0);
    const auto pull = [&](std::size_t from, std::size_t to) {
      ++neighbours[to];
      if (!edge[from]) {
        sum[to] += lean[from];
        return;
      }
      const Vec3 offset = top_offset(from);
      if (offset.dot(mesh.position[columns.bottom[to]] - mesh.position[columns.bottom[from]]) > 0) sum[to] += offset;
    };
    for (const auto& [a, b] : beside) {
      pull(static_cast<std::size_t>(a), static_cast<std::size_t>(b));
      pull(static_cast<std::size_t>(b), static_cast<std::size_t>(a));
    }
    for (std::size_t c = 0; c < count; ++c) {
      if (!leans[c] || neighbours[c] == 0) continue;
      const Vec3 mean = sum[c] * (kLeanDecay / neighbours[c]), n = feet[c].direction;
      lean[c] = mean - n * n.dot(mean);
    }
  }
  for (std::size_t c = 0; c < count; ++c) {
    if (!leans[c] || lean[c].norm() <= kLeastLean * thickness[c]) continue;
    const Vec3 offset = top_offset(c) + lean[c];
    feet[c].direction = offset.normalized();
    feet[c].stretch = offset.norm() / thickness[c];
  }
}

}  // namespace strata
