#include "core/layers/corner_fan.h"

#include <algorithm>
#include <cstddef>

#include "core/layers/wall.h"

namespace strata {
namespace {

std::size_t corner_at(const QuadVertices& q, VertexId v) { return static_cast<std::size_t>(std::find(q.begin(), q.end(), v) - q.begin()); }

// From the facet on, across the edge that leaves the vertex, until the facet comes again. Nothing: the wall is not closed there.
CornerFan fan_from(const HexMesh& mesh, const JoinedFacets& facets, FacetIndex first, VertexId v) {
  constexpr int kMost = 64;
  CornerFan fan;
  fan.vertex = v;
  FacetIndex f = first;
  for (int i = 0; i < kMost; ++i) {
    const QuadVertices q = facets.vertices(f);
    const std::size_t at = corner_at(q, v);
    if (at == 4) return {};
    const Vec3 next = mesh.position[q[(at + 1) & 3]] - mesh.position[v], before = mesh.position[q[(at + 3) & 3]] - mesh.position[v];
    const FacetNeighbour n = facets.neighbour(f, static_cast<int>(at));
    if (n.facet == kNoFacet) return {};
    fan.facet.push_back(f);
    fan.normal.push_back(before.cross(next).normalized());
    fan.spoke.push_back(next.normalized());
    fan.crease.push_back(facets.front(f) != facets.front(n.facet));
    f = n.facet;
    if (f == first) return fan;
  }
  return {};
}

double triple(const Vec3& a, const Vec3& b, const Vec3& c) { return a.cross(b).dot(c); }

// A run of facets of one group: first .. last, wrapping round; the spokes it begins and ends at.
struct Run {
  std::size_t first = 0, count = 0;
};
std::vector<Run> runs_of(const std::vector<std::int32_t>& group) {
  const std::size_t n = group.size();
  std::vector<Run> runs;
  for (std::size_t i = 0; i < n; ++i)
    if (group[i] != group[(i + n - 1) % n]) runs.push_back({i, 0});
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const std::size_t next = runs[(r + 1) % runs.size()].first;
    runs[r].count = (next + n - runs[r].first - 1) % n + 1;
  }
  return runs;
}

std::vector<Vec3> normals_of(const CornerFan& fan, const Run& run) {
  std::vector<Vec3> result;
  for (std::size_t i = 0; i < run.count; ++i) result.push_back(fan.normal[(run.first + i) % fan.normal.size()]);
  return result;
}

// The column of the group that stands on `standing`, which slides on the surface of `on`: along a crease that leaves there, or else away
// from the edges where the two meet.
Vec3 sliding_column(const CornerFan& fan, const Run& standing, const Run& on) {
  const std::size_t n = fan.facet.size();
  const Vec3 wished = most_visible(normals_of(fan, standing));
  Vec3 best = Vec3::Zero();
  double best_fit = -2;
  for (std::size_t i = 0; i + 1 < on.count; ++i) {
    const std::size_t s = (on.first + i) % n;
    if (fan.crease[s] && fan.spoke[s].dot(wished) > best_fit) best_fit = fan.spoke[s].dot(wished), best = fan.spoke[s];
  }
  if (best_fit > -2) return best;
  const std::size_t last = (on.first + on.count - 1) % n;
  const Vec3 &begin = fan.spoke[(on.first + n - 1) % n], &end = fan.spoke[last];
  Vec3 normal = Vec3::Zero();
  for (const Vec3& m : normals_of(fan, on)) normal += m;
  normal.normalize();
  const Vec3 seen = most_visible({fan.normal[on.first].cross(begin).normalized(), end.cross(fan.normal[last]).normalized()});
  const Vec3 in_plane = seen - normal * normal.dot(seen);
  return in_plane.norm() > 0 ? Vec3(in_plane.normalized()) : in_plane;
}

double joint_quality(const CornerFan& fan) {
  const Vec3 column = most_visible(fan.normal);
  double worst = 1;
  for (const Vec3& n : fan.normal) worst = std::min(worst, n.dot(column));
  return worst;
}

double crossing_quality(const CornerFan& fan, const Run& a, const Run& b) {
  const std::size_t n = fan.facet.size();
  const Vec3 of_a = sliding_column(fan, a, b), of_b = sliding_column(fan, b, a);
  const Vec3 &from_a = fan.spoke[(a.first + a.count - 1) % n], &from_b = fan.spoke[(b.first + b.count - 1) % n];
  return std::min(triple(of_b, from_a, of_a), triple(of_a, from_b, of_b));
}

}  // namespace

std::vector<CornerFan> corner_fans(const HexMesh& mesh, const JoinedFacets& facets) {
  std::vector<CornerFan> fans;
  IdMap<VertexId, std::vector<FacetIndex>> seen(mesh.position.size());
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(facets.slots()); ++f) {
    if (!facets.exists(f)) continue;
    for (VertexId v : facets.vertices(f)) {
      if (mesh.attachment[v].hold != Hold::Corner || std::find(seen[v].begin(), seen[v].end(), f) != seen[v].end()) continue;
      CornerFan fan = fan_from(mesh, facets, f, v);
      if (fan.facet.empty()) continue;
      seen[v].insert(seen[v].end(), fan.facet.begin(), fan.facet.end());
      fans.push_back(std::move(fan));
    }
  }
  return fans;
}

double corner_quality(const CornerFan& fan, const std::vector<std::int32_t>& group) {
  const std::vector<Run> runs = runs_of(group);
  const std::size_t n = fan.facet.size();
  if (runs.empty()) return joint_quality(fan);
  if (runs.size() == 2) return crossing_quality(fan, runs[0], runs[1]);
  if (runs.size() != 3) return 1;
  const auto before = [&](const Run& run) { return fan.spoke[(run.first + n - 1) % n]; };
  return triple(before(runs[0]), before(runs[1]), before(runs[2]));
}

std::vector<std::int32_t> better_joined(const CornerFan& fan, const std::vector<std::int32_t>& group) {
  std::vector<std::int32_t> letters = group;
  std::sort(letters.begin(), letters.end());
  letters.erase(std::unique(letters.begin(), letters.end()), letters.end());
  if (letters.size() < 2) return {};
  std::vector<std::vector<std::int32_t>> choices{letters};
  for (std::size_t i = 0; letters.size() > 2 && i < letters.size(); ++i)
    for (std::size_t j = i + 1; j < letters.size(); ++j) choices.push_back({letters[i], letters[j]});
  double best = corner_quality(fan, group);
  std::vector<std::int32_t> chosen;
  for (const std::vector<std::int32_t>& choice : choices) {
    std::vector<std::int32_t> then = group;
    for (std::int32_t& g : then)
      if (std::find(choice.begin(), choice.end(), g) != choice.end()) g = choice.front();
    if (const double quality = corner_quality(fan, then); quality > best) best = quality, chosen = choice;
  }
  return chosen;
}

}  // namespace strata
