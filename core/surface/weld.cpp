// Points that are one place become one point; triangles that are nothing vanish.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "core/base/parallel.h"
#include "core/base/triangle_geometry.h"
#include "core/surface/draft.h"

namespace strata {
namespace {

bool lexicographic(const Vec3& a, const Vec3& b) {
  for (int i = 0; i < 3; ++i)
    if (a[i] != b[i]) return a[i] < b[i];
  return false;
}

double length2(const Draft& draft, std::int32_t a, std::int32_t b) {
  return (draft.points[static_cast<std::size_t>(a)] - draft.points[static_cast<std::size_t>(b)]).squaredNorm();
}

bool repeats_a_corner(const std::array<std::int32_t, 3>& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

// Grid cells of the weld distance; the working frame keeps the cell numbers within 21 bits.
constexpr std::int64_t kGridOffset = 1 << 20;
std::array<std::int64_t, 3> cell_of(const Vec3& p) {
  std::array<std::int64_t, 3> cell;
  for (int i = 0; i < 3; ++i) cell[static_cast<std::size_t>(i)] = static_cast<std::int64_t>(std::floor(p[i] / kWeldDistance)) + kGridOffset;
  return cell;
}
std::int64_t key_of(const std::array<std::int64_t, 3>& cell) { return (cell[0] << 42) | (cell[1] << 21) | cell[2]; }

}  // namespace

std::int64_t weld_equal(Draft& draft) {
  std::vector<std::int32_t> order(draft.points.size());
  std::iota(order.begin(), order.end(), 0);
  const auto at = [&](std::int32_t i) -> const Vec3& { return draft.points[static_cast<std::size_t>(i)]; };
  parallel_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    if (lexicographic(at(a), at(b))) return true;
    if (lexicographic(at(b), at(a))) return false;
    return a < b;
  });
  std::vector<std::int32_t> by(draft.points.size());
  std::int64_t vanished = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && at(order[i]) == at(order[i - 1]);
    by[static_cast<std::size_t>(order[i])] = same ? by[static_cast<std::size_t>(order[i - 1])] : order[i];
    vanished += same;
  }
  draft.replace_points(by);
  return vanished;
}

std::int64_t weld_borders(Draft& draft) {
  // Reach of each border point: the weld distance, or less where edges are short.
  std::vector<double> reach(draft.points.size(), 0);
  std::vector<std::int32_t> border;
  for (const OpenEdge& e : open_edges(draft))
    for (const std::int32_t p : {e.from, e.to}) {
      if (reach[static_cast<std::size_t>(p)] == 0) border.push_back(p);
      reach[static_cast<std::size_t>(p)] = kWeldDistance;
    }
  if (border.empty()) return 0;
  std::sort(border.begin(), border.end());
  for (const auto& t : draft.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const double edge = std::sqrt(length2(draft, t[i], t[(i + 1) % 3]));
      if (edge < kNothing) continue;
      for (const std::int32_t p : {t[i], t[(i + 1) % 3]})
        reach[static_cast<std::size_t>(p)] = std::min(reach[static_cast<std::size_t>(p)], kWeldOfEdge * edge);
    }

  struct Entry {
    std::int64_t key;
    std::int32_t point;
    auto operator<=>(const Entry&) const = default;
  };
  std::vector<Entry> grid;
  for (const std::int32_t p : border) grid.push_back({key_of(cell_of(draft.points[static_cast<std::size_t>(p)])), p});
  parallel_sort(grid.begin(), grid.end());

  // In order of index each point joins the nearest kept point before it within reach, or is kept: no chains.
  std::vector<std::int32_t> by(draft.points.size());
  std::iota(by.begin(), by.end(), 0);
  std::int64_t vanished = 0;
  for (const std::int32_t p : border) {
    const auto cell = cell_of(draft.points[static_cast<std::size_t>(p)]);
    double nearest = std::numeric_limits<double>::infinity();
    std::int32_t to = p;
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y) {
        // Three cells along z are neighbours in the key order.
        const std::int64_t key = key_of({cell[0] + x, cell[1] + y, cell[2]});
        for (auto e = std::lower_bound(grid.begin(), grid.end(), Entry{key - 1, -1}); e != grid.end() && e->key <= key + 1; ++e) {
          if (e->point >= p || by[static_cast<std::size_t>(e->point)] != e->point) continue;
          const double d = std::sqrt(length2(draft, p, e->point));
          const double within = std::min(reach[static_cast<std::size_t>(p)], reach[static_cast<std::size_t>(e->point)]);
          if (d <= within && d < nearest) {
            nearest = d;
            to = e->point;
          }
        }
      }
    by[static_cast<std::size_t>(p)] = to;
    vanished += to != p;
  }
  draft.replace_points(by);
  return vanished;
}

Repair collapse_needles(Draft& draft) {
  Repair repair;
  std::vector<std::int32_t> by(draft.points.size());
  std::iota(by.begin(), by.end(), 0);
  const auto find = [&](std::int32_t p) {
    while (by[static_cast<std::size_t>(p)] != p) p = by[static_cast<std::size_t>(p)];
    return p;
  };
  for (const auto& t : draft.triangles) {
    if (repeats_a_corner(t)) continue;
    std::array<double, 3> edge;
    for (std::size_t i = 0; i < 3; ++i) edge[i] = std::sqrt(length2(draft, t[i], t[(i + 1) % 3]));
    const double longest = std::max({edge[0], edge[1], edge[2]});
    const double flat = std::max(kNothing, std::min(kFlatDistance, kFlatOfEdge * longest));
    for (std::size_t i = 0; i < 3; ++i) {
      if (edge[i] >= flat) continue;
      const auto [low, high] = std::minmax({find(t[i]), find(t[(i + 1) % 3])});
      by[static_cast<std::size_t>(high)] = low;
    }
  }
  for (std::size_t p = 0; p < by.size(); ++p) by[p] = find(static_cast<std::int32_t>(p));
  std::vector<char> kept(draft.size(), 1);
  draft.replace_points(by);
  for (std::size_t t = 0; t < draft.size(); ++t)
    if (repeats_a_corner(draft.triangles[t])) {
      kept[t] = 0;
      note(repair, draft, t);
    }
  draft.keep(kept);
  return repair;
}

Repair drop_flat(Draft& draft) {
  Repair repair;
  std::vector<char> kept(draft.size(), 1);
  for (std::size_t t = 0; t < draft.size(); ++t) {
    const auto& [ia, ib, ic] = draft.triangles[t];
    const Vec3 &a = draft.points[static_cast<std::size_t>(ia)], &b = draft.points[static_cast<std::size_t>(ib)],
               &c = draft.points[static_cast<std::size_t>(ic)];
    const double longest = std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
    if (smallest_altitude(a, b, c) >= std::max(kNothing, std::min(kFlatDistance, kFlatOfEdge * longest))) continue;
    kept[t] = 0;
    note(repair, draft, t);
  }
  draft.keep(kept);
  return repair;
}

Duplicates drop_duplicates(Draft& draft) {
  struct Entry {
    std::array<std::int32_t, 3> points;
    std::int32_t triangle;
    bool operator<(const Entry& other) const { return std::tie(points, triangle) < std::tie(other.points, other.triangle); }
  };
  std::vector<Entry> entries(draft.size());
  parallel_for(draft.size(), [&](std::size_t t) {
    entries[t] = {draft.triangles[t], static_cast<std::int32_t>(t)};
    std::sort(entries[t].points.begin(), entries[t].points.end());
  });
  parallel_sort(entries.begin(), entries.end());
  // The cyclic order of the corners tells the orientation.
  const auto even = [&](std::int32_t triangle) {
    auto t = draft.triangles[static_cast<std::size_t>(triangle)];
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t[1] < t[2];
  };
  Duplicates found;
  std::vector<char> kept(draft.size(), 1);
  for (std::size_t i = 1, first = 0; i < entries.size(); ++i) {
    if (entries[i].points != entries[first].points) {
      first = i;
      continue;
    }
    const auto t = static_cast<std::size_t>(entries[i].triangle);
    kept[t] = 0;
    note(even(entries[i].triangle) == even(entries[first].triangle) ? found.same : found.opposite, draft, t);
  }
  draft.keep(kept);
  return found;
}

}  // namespace strata
