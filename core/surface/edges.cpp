#include <algorithm>
#include <numeric>

#include "core/base/parallel.h"
#include "core/surface/draft.h"

namespace strata {

void Draft::keep(const std::vector<char>& kept) {
  std::size_t to = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (!kept[t]) continue;
    triangles[to] = triangles[t];
    patch[to] = patch[t];
    source[to] = source[t];
    ++to;
  }
  triangles.resize(to);
  patch.resize(to);
  source.resize(to);
}

void Draft::replace_points(const std::vector<std::int32_t>& by) {
  parallel_for(triangles.size(), [&](std::size_t t) {
    for (std::int32_t& p : triangles[t]) p = by[static_cast<std::size_t>(p)];
  });
}

std::vector<Side> sorted_sides(const std::vector<std::array<std::int32_t, 3>>& triangles) {
  std::vector<Side> sides(3 * triangles.size());
  parallel_for(triangles.size(), [&](std::size_t t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(triangles[t][i], triangles[t][(i + 1) % 3]);
      sides[3 * t + i] = {low, high, static_cast<std::int32_t>(t), static_cast<std::int32_t>(i)};
    }
  });
  parallel_sort(sides.begin(), sides.end());
  return sides;
}

std::vector<OpenEdge> open_edges(const Draft& draft) {
  const std::vector<Side> sides = sorted_sides(draft.triangles);
  std::vector<OpenEdge> open;
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    if (last != first + 1) return;
    const Side& s = sides[first];
    const auto& corners = draft.triangles[static_cast<std::size_t>(s.triangle)];
    open.push_back({corners[static_cast<std::size_t>(s.side)], corners[static_cast<std::size_t>((s.side + 1) % 3)], s.triangle, s.side});
  });
  return open;
}

void note(Repair& repair, const Draft& draft, std::size_t triangle) {
  ++repair.count;
  repair.triangles.push_back(draft.source[triangle]);
  for (const std::int32_t p : draft.triangles[triangle]) repair.box.add(draft.points[static_cast<std::size_t>(p)]);
}

std::vector<std::int32_t> components(const std::vector<std::array<std::int32_t, 3>>& triangles, const std::vector<Side>& sides) {
  std::vector<std::int32_t> root(triangles.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](std::int32_t t) {
    while (root[static_cast<std::size_t>(t)] != t) {
      std::int32_t& up = root[static_cast<std::size_t>(t)];
      up = root[static_cast<std::size_t>(up)];
      t = up;
    }
    return t;
  };
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first + 1; i < last; ++i) {
      const auto [low, high] = std::minmax({find(sides[first].triangle), find(sides[i].triangle)});
      root[static_cast<std::size_t>(high)] = low;  // the smallest triangle is the root
    }
  });
  std::vector<std::int32_t> number(triangles.size());
  std::int32_t count = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const std::int32_t r = find(static_cast<std::int32_t>(t));
    number[t] = static_cast<std::size_t>(r) == t ? count++ : number[static_cast<std::size_t>(r)];
  }
  return number;
}

}  // namespace strata
