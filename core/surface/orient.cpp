// Consistent orientation, and what is no boundary of a volume.
#include <algorithm>
#include <cmath>

#include "core/surface/draft.h"

namespace strata {
namespace {

// Six times the signed volume of the cone of the triangle over `apex`.
double cone_volume(const Draft& draft, const Vec3& apex, std::size_t t) {
  const auto& [a, b, c] = draft.triangles[t];
  const auto at = [&](std::int32_t i) -> Vec3 { return draft.points[static_cast<std::size_t>(i)] - apex; };
  return at(a).dot(at(b).cross(at(c)));
}

bool same_direction(const Draft& draft, const Side& a, const Side& b) {
  const auto start = [&](const Side& s) { return draft.triangles[static_cast<std::size_t>(s.triangle)][static_cast<std::size_t>(s.side)]; };
  return start(a) == start(b);
}

}  // namespace

Repair orient(Draft& draft) {
  const std::size_t count = draft.size();
  const std::vector<Side> sides = sorted_sides(draft.triangles);
  // Across manifold edges only: neighbour 3 t + i, and whether it runs the edge the same way (then one of them is turned).
  std::vector<std::int32_t> neighbour(3 * count, -1);
  std::vector<char> against(3 * count, 0);
  std::vector<char> open_piece_edge(count, 0);
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    if (last - first != 2) {
      for (std::size_t i = first; i < last; ++i) open_piece_edge[static_cast<std::size_t>(sides[i].triangle)] = 1;
      return;
    }
    const Side &a = sides[first], &b = sides[first + 1];
    const bool turned = same_direction(draft, a, b);
    neighbour[static_cast<std::size_t>(3 * a.triangle + a.side)] = b.triangle;
    neighbour[static_cast<std::size_t>(3 * b.triangle + b.side)] = a.triangle;
    against[static_cast<std::size_t>(3 * a.triangle + a.side)] = against[static_cast<std::size_t>(3 * b.triangle + b.side)] = turned;
  });

  std::vector<char> seen(count, 0), turn(count, 0);
  std::vector<std::int32_t> piece;
  for (std::size_t seed = 0; seed < count; ++seed) {
    if (seen[seed]) continue;
    piece.assign(1, static_cast<std::int32_t>(seed));
    seen[seed] = 1;
    bool closed = true;
    for (std::size_t at = 0; at < piece.size(); ++at) {
      const auto t = static_cast<std::size_t>(piece[at]);
      closed = closed && !open_piece_edge[t];
      for (std::size_t i = 0; i < 3; ++i) {
        const std::int32_t n = neighbour[3 * t + i];
        if (n < 0 || seen[static_cast<std::size_t>(n)]) continue;  // a Moebius piece stays contradictory where it closes
        seen[static_cast<std::size_t>(n)] = 1;
        turn[static_cast<std::size_t>(n)] = turn[t] ^ against[3 * t + i];
        piece.push_back(n);
      }
    }
    // A closed piece points outwards. An open one keeps the direction most of its area had.
    const auto& seed_corners = draft.triangles[seed];
    const Vec3 apex = draft.points[static_cast<std::size_t>(seed_corners[0])];
    double volume = 0, kept_area = 0;
    for (const std::int32_t i : piece) {
      const auto t = static_cast<std::size_t>(i);
      const double sign = turn[t] ? -1 : 1;
      volume += sign * cone_volume(draft, apex, t);
      const auto& [a, b, c] = draft.triangles[t];
      const auto p = [&](std::int32_t k) -> const Vec3& { return draft.points[static_cast<std::size_t>(k)]; };
      kept_area += sign * (p(b) - p(a)).cross(p(c) - p(a)).norm();
    }
    if ((closed && volume != 0 ? volume : kept_area) < 0)
      for (const std::int32_t t : piece) turn[static_cast<std::size_t>(t)] ^= 1;
  }

  Repair repair;
  for (std::size_t t = 0; t < count; ++t) {
    if (!turn[t]) continue;
    std::swap(draft.triangles[t][1], draft.triangles[t][2]);
    note(repair, draft, t);
  }
  return repair;
}

Repair drop_sheets(Draft& draft) {
  const std::vector<Side> sides = sorted_sides(draft.triangles);
  const std::vector<std::int32_t> component = components(draft.triangles, sides);
  const auto count = static_cast<std::size_t>(component.empty() ? 0 : 1 + *std::max_element(component.begin(), component.end()));
  std::vector<std::int64_t> open(count, 0), edges(count, 0);
  for_each_edge(sides, [&](std::size_t first, std::size_t last) {
    const auto c = static_cast<std::size_t>(component[static_cast<std::size_t>(sides[first].triangle)]);
    ++edges[c];
    open[c] += last == first + 1;
  });
  // A sheet bounds no volume to speak of: its volume, closed by a cone over its border, is small against its area^1.5.
  constexpr double kSheetVolume = 1e-3;  // a sphere has 0.094, a cube 0.068, a 1:20 plate 0.016
  std::vector<double> volume(count, 0), area(count, 0);
  std::vector<Vec3> apex(count, Vec3::Zero());
  std::vector<std::int64_t> corners(count, 0);
  for (const OpenEdge& e : open_edges(draft)) {
    const auto c = static_cast<std::size_t>(component[static_cast<std::size_t>(e.triangle)]);
    apex[c] += draft.points[static_cast<std::size_t>(e.from)] + draft.points[static_cast<std::size_t>(e.to)];
    corners[c] += 2;
  }
  for (std::size_t c = 0; c < count; ++c) apex[c] /= static_cast<double>(std::max<std::int64_t>(corners[c], 1));
  for (std::size_t t = 0; t < draft.size(); ++t) {
    const auto c = static_cast<std::size_t>(component[t]);
    const auto& [i, j, k] = draft.triangles[t];
    const auto p = [&](std::int32_t q) -> const Vec3& { return draft.points[static_cast<std::size_t>(q)]; };
    volume[c] += cone_volume(draft, apex[c], t) / 6;
    area[c] += 0.5 * (p(j) - p(i)).cross(p(k) - p(i)).norm();
  }
  const bool some_closed = std::any_of(open.begin(), open.end(), [](std::int64_t n) { return n == 0; });
  Repair repair;
  if (!some_closed) return repair;
  std::vector<char> kept(draft.size(), 1);
  for (std::size_t t = 0; t < draft.size(); ++t) {
    const auto c = static_cast<std::size_t>(component[t]);
    if (open[c] == 0 || std::abs(volume[c]) > kSheetVolume * std::pow(area[c], 1.5)) continue;
    kept[t] = 0;
    note(repair, draft, t);
  }
  draft.keep(kept);
  return repair;
}

}  // namespace strata
