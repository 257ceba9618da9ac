#include "core/carve/triangle_sides.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/base/parallel.h"

namespace strata {
namespace {

// The most frequent colour of a run of sightings, ties to the smaller.
std::int32_t most_frequent(const Sighting* begin, const Sighting* end) {
  std::int32_t best = kUndecided;
  std::ptrdiff_t most = 0;
  for (const Sighting* at = begin; at != end;) {
    const Sighting* stop = std::find_if(at, end, [&](const Sighting& s) { return s.colour != at->colour; });
    if (stop - at > most) {
      most = stop - at;
      best = at->colour;
    }
    at = stop;
  }
  return best;
}

Bounds bounds_between(std::int32_t behind, std::int32_t front) {
  if (behind == front) return Bounds::Nothing;
  if (behind >= 0 && front >= 0) return Bounds::Interface;
  return behind >= 0 || front >= 0 ? Bounds::Wall : Bounds::Nothing;
}

// How many nodes see a triangle, from behind and from in front.
using Seen = std::array<std::int64_t, 2>;

// That nothing is bounded takes more than a stray ray through an edge: connected triangles must together be seen from both sides, often and
// about equally. Others are taken for unknown.
constexpr std::int64_t kSeenOften = 8;
constexpr std::int64_t kSeenEqually = 4;  // at most so many times as often from the one side as from the other

void doubt_what_few_saw(const Surface& surface, const IdMap<TriangleId, Seen>& seen, IdMap<TriangleId, Bounds>& bounds) {
  IdMap<TriangleId, std::uint8_t> grouped(bounds.size(), std::uint8_t{0});
  std::vector<TriangleId> group;
  for (TriangleId first : bounds.ids()) {
    if (bounds[first] != Bounds::Nothing || grouped[first] != 0) continue;
    group.assign(1, first);
    grouped[first] = 1;
    Seen sum{};
    for (std::size_t i = 0; i < group.size(); ++i) {
      for (const std::size_t side : {0, 1}) sum[side] += seen[group[i]][side];
      for (TriangleId n : surface.neighbours[group[i]]) {
        if (!n.valid() || bounds[n] != Bounds::Nothing || grouped[n] != 0) continue;
        grouped[n] = 1;
        group.push_back(n);
      }
    }
    const auto [less, more] = std::minmax(sum[0], sum[1]);
    if (less >= kSeenOften && more <= kSeenEqually * less) continue;
    for (TriangleId t : group) bounds[t] = Bounds::Unknown;
  }
}

// From triangle to triangle over shared edges, ring by ring.
void follow_neighbours(const Surface& surface, IdMap<TriangleId, Bounds>& bounds) {
  std::vector<TriangleId> ring;
  for (TriangleId t : surface.triangles.ids())
    if (bounds[t] != Bounds::Unknown) ring.push_back(t);
  while (!ring.empty()) {
    std::vector<std::pair<TriangleId, Bounds>> next;
    for (TriangleId t : ring)
      for (TriangleId n : surface.neighbours[t])
        if (n.valid() && bounds[n] == Bounds::Unknown) next.emplace_back(n, bounds[t]);
    std::sort(next.begin(), next.end(),
              [](const auto& a, const auto& b) { return a.first != b.first ? a.first < b.first : a.second > b.second; });
    ring.clear();
    for (const auto& [t, b] : next) {
      if (bounds[t] != Bounds::Unknown) continue;
      bounds[t] = b;
      ring.push_back(t);
    }
  }
}

}  // namespace

IdMap<TriangleId, Bounds> judge_triangles(const Surface& surface, std::vector<Sighting> sightings) {
  parallel_sort(sightings.begin(), sightings.end());
  IdMap<TriangleId, Bounds> bounds(surface.triangles.size(), Bounds::Unknown);
  IdMap<TriangleId, Seen> seen(surface.triangles.size(), Seen{});
  for (std::size_t i = 0; i < sightings.size();) {
    std::array<std::int32_t, 2> side{kUndecided, kUndecided};  // behind, in front
    const TriangleId t = sightings[i].triangle;
    while (i < sightings.size() && sightings[i].triangle == t) {
      std::size_t stop = i;
      while (stop < sightings.size() && sightings[stop].triangle == t && sightings[stop].front == sightings[i].front) ++stop;
      seen[t][static_cast<std::size_t>(sightings[i].front)] = static_cast<std::int64_t>(stop - i);
      side[static_cast<std::size_t>(sightings[i].front)] = most_frequent(sightings.data() + i, sightings.data() + stop);
      i = stop;
    }
    if (side[0] != kUndecided && side[1] != kUndecided) bounds[t] = bounds_between(side[0], side[1]);
  }
  follow_neighbours(surface, bounds);
  doubt_what_few_saw(surface, seen, bounds);
  follow_neighbours(surface, bounds);
  return bounds;
}

}  // namespace strata
