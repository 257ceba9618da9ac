// Openings are closed by caps: a missing inlet, the gap between a rim and its lid.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/triangle_geometry.h"
#include "core/surface/draft.h"

namespace strata {
namespace {

constexpr double kFlat = 0.02;        // of the root of the cap's area: a border is flat when it is no further out of its plane,
constexpr double kBent = 0.25;        // and too bent for a cap when it is further than this
constexpr double kSamePlane = 0.999;  // cosine between a cap and one inside it
constexpr double kMostOpen = 0.12;    // of the shells' area, caps included: more is a side that is missing
constexpr std::size_t kMostPoints = 2000;         // of a border, with those inside it
constexpr std::size_t kMostPasses = 64;           // over a polygon's corners, looking for ears
constexpr std::size_t kMostWithIslands = 4000;    // rims: among more none is looked for inside another
constexpr std::size_t kMostLooks = 100'000'000;   // triangles looked at to tell walls: what is left, the smallest, stays open
constexpr std::size_t kMostBridges = 64;  // tried between a border and one inside it
constexpr double kTiny = 1e-4;        // of the shells' area: such a cap is a wall for certain
constexpr double kAside = 0.3;        // of the size of a flat cap's largest triangle: where it is looked at from either side
constexpr double kAsideBent = 0.25;   // of the root of the area of one that is not flat
constexpr double kWhole = 1e-6;       // of the cap's area, that triangles may miss or overlap

using Point2 = Eigen::Vector2d;

double cross(const Point2& a, const Point2& b) { return a.x() * b.y() - a.y() * b.x(); }

// A closed border, in the direction that triangles closing it would have.
struct Rim {
  std::vector<std::int32_t> points;
  std::vector<std::int32_t> triangles;  // beside its edges
  Vec3 area = Vec3::Zero();             // vector along the cap's normal
  Vec3 centre = Vec3::Zero();
  double out_of_plane = 0;              // the farthest point
  [[nodiscard]] bool is_flat() const { return out_of_plane < kFlat * size(); }
  [[nodiscard]] double size() const { return std::sqrt(area.norm()); }
};

const Vec3& at(const Draft& draft, std::int32_t p) { return draft.points[static_cast<std::size_t>(p)]; }

// A walk along open edges that comes back to one of its points leaves a border behind, also where borders touch.
std::vector<std::vector<OpenEdge>> closed_borders(const Draft& draft) {
  std::vector<OpenEdge> open = open_edges(draft);
  std::sort(open.begin(), open.end(), [](const OpenEdge& a, const OpenEdge& b) { return std::tie(a.to, a.from) < std::tie(b.to, b.from); });
  std::vector<std::size_t> next(draft.points.size() + 1, 0);  // of the edges that end at a point, the first not walked yet
  for (const OpenEdge& e : open) ++next[static_cast<std::size_t>(e.to) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  const std::vector<std::size_t> stop(next.begin() + 1, next.end());
  std::vector<std::int32_t> position(draft.points.size(), -1);  // on the walk
  std::vector<std::vector<OpenEdge>> borders;
  for (std::size_t seed = 0; seed < draft.points.size(); ++seed) {
    std::vector<OpenEdge> walk;
    for (auto p = seed; next[p] < stop[p];) {
      position[p] = static_cast<std::int32_t>(walk.size());
      walk.push_back(open[next[p]++]);
      p = static_cast<std::size_t>(walk.back().from);
      if (position[p] < 0) continue;
      const auto first = walk.begin() + position[p];
      for (auto e = first; e != walk.end(); ++e) position[static_cast<std::size_t>(e->to)] = -1;
      borders.emplace_back(first, walk.end());
      walk.erase(first, walk.end());
    }
    for (const OpenEdge& e : walk) position[static_cast<std::size_t>(e.to)] = -1;
  }
  return borders;
}

std::vector<Rim> rims_of(const Draft& draft) {
  std::vector<Rim> rims;
  for (const std::vector<OpenEdge>& border : closed_borders(draft)) {
    if (border.size() < 3 || border.size() > kMostPoints) continue;
    Rim rim;
    for (const OpenEdge& edge : border) {
      rim.points.push_back(edge.to);
      rim.triangles.push_back(edge.triangle);
      rim.centre += at(draft, edge.to);
    }
    rim.centre /= static_cast<double>(rim.points.size());
    for (std::size_t i = 0; i < rim.points.size(); ++i)
      rim.area += 0.5 * (at(draft, rim.points[i]) - rim.centre).cross(at(draft, rim.points[(i + 1) % rim.points.size()]) - rim.centre);
    if (!(rim.area.norm() > 0)) continue;
    const Vec3 normal = rim.area.normalized();
    for (std::int32_t p : rim.points) rim.out_of_plane = std::max(rim.out_of_plane, std::abs((at(draft, p) - rim.centre).dot(normal)));
    if (rim.out_of_plane < kBent * rim.size()) rims.push_back(std::move(rim));
  }
  return rims;
}

// A flat polygon, and the corners of a border inside it once that is joined to it.
struct Polygon {
  std::vector<std::int32_t> points;
  std::vector<Point2> flat;
};

class Plane {
 public:
  explicit Plane(const Rim& rim)
      : origin_(rim.centre), normal_(rim.area.normalized()), u_(normal_.unitOrthogonal()), v_(normal_.cross(u_)) {}
  [[nodiscard]] Point2 flat(const Vec3& p) const { return {(p - origin_).dot(u_), (p - origin_).dot(v_)}; }
  [[nodiscard]] Polygon polygon(const Draft& draft, const Rim& rim) const {
    Polygon result{rim.points, {}};
    for (std::int32_t p : rim.points) result.flat.push_back(flat(at(draft, p)));
    return result;
  }

 private:
  Vec3 origin_, normal_, u_, v_;
};

double area_of(const std::vector<Point2>& polygon) {
  double twice = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) twice += cross(polygon[i], polygon[(i + 1) % polygon.size()]);
  return 0.5 * twice;
}

bool holds(const std::vector<Point2>& polygon, const Point2& p) {
  bool inside = false;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Point2 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    if ((a.y() > p.y()) != (b.y() > p.y()) && p.x() < a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) inside = !inside;
  }
  return inside;
}

bool crosses(const std::vector<Point2>& polygon, const Point2& from, const Point2& to) {
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Point2 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    if (a == from || a == to || b == from || b == to) continue;
    if (cross(to - from, a - from) * cross(to - from, b - from) <= 0 && cross(b - a, from - a) * cross(b - a, to - a) <= 0) return true;
  }
  return false;
}

// One polygon of two, joined by an edge that runs there and back. False: none was found.
bool join(Polygon& outer, const Polygon& inner) {
  if (outer.points.size() + inner.points.size() > kMostPoints) return false;
  std::vector<std::tuple<double, std::size_t, std::size_t>> bridges;
  for (std::size_t i = 0; i < outer.flat.size(); ++i)
    for (std::size_t j = 0; j < inner.flat.size(); ++j) bridges.emplace_back((outer.flat[i] - inner.flat[j]).squaredNorm(), i, j);
  const auto tried = static_cast<std::ptrdiff_t>(std::min(kMostBridges, bridges.size()));
  std::partial_sort(bridges.begin(), bridges.begin() + tried, bridges.end());
  for (std::ptrdiff_t k = 0; k < tried; ++k) {
    const auto [distance, i, j] = bridges[static_cast<std::size_t>(k)];
    if (crosses(outer.flat, outer.flat[i], inner.flat[j]) || crosses(inner.flat, outer.flat[i], inner.flat[j])) continue;
    const auto splice = [&](auto& into, const auto& from) {
      std::vector inserted(from.begin() + static_cast<std::ptrdiff_t>(j), from.end());
      inserted.insert(inserted.end(), from.begin(), from.begin() + static_cast<std::ptrdiff_t>(j) + 1);
      inserted.push_back(into[i]);
      into.insert(into.begin() + static_cast<std::ptrdiff_t>(i) + 1, inserted.begin(), inserted.end());
    };
    splice(outer.points, inner.points);
    splice(outer.flat, inner.flat);
    return true;
  }
  return false;
}

using Corners = std::array<std::int32_t, 3>;

// By cutting off ears. Nothing: the polygon crosses itself.
std::optional<std::vector<Corners>> triangulated(Polygon polygon) {
  const double whole = area_of(polygon.flat);
  double covered = 0;
  std::vector<Corners> triangles;
  auto& [points, flat] = polygon;
  const auto is_ear = [&](std::size_t i) {
    const std::size_t n = flat.size();
    const Point2 &a = flat[(i + n - 1) % n], &b = flat[i], &c = flat[(i + 1) % n];
    if (!(cross(b - a, c - b) > 0)) return false;
    return std::none_of(flat.begin(), flat.end(), [&](const Point2& p) {
      if (p == a || p == b || p == c) return false;
      return cross(b - a, p - a) >= 0 && cross(c - b, p - b) >= 0 && cross(a - c, p - c) >= 0;
    });
  };
  std::size_t at_corner = 0, looks = kMostPasses * flat.size();
  for (std::size_t passed = 0; flat.size() > 2 && passed < flat.size(); --looks) {
    if (looks == 0) return {};
    const std::size_t n = flat.size(), i = at_corner % n, before = (i + n - 1) % n, after = (i + 1) % n;
    if (!is_ear(i)) {
      ++at_corner;
      ++passed;
      continue;
    }
    covered += 0.5 * cross(flat[i] - flat[before], flat[after] - flat[i]);
    triangles.push_back({points[before], points[i], points[after]});
    points.erase(points.begin() + static_cast<std::ptrdiff_t>(i));
    flat.erase(flat.begin() + static_cast<std::ptrdiff_t>(i));
    at_corner = i + 1;  // the corner after next: no fan round one point
    passed = 0;
  }
  if (flat.size() > 2 && std::abs(area_of(flat)) > kWhole * whole) return {};
  if (std::abs(covered - whole) > kWhole * whole) return {};
  return triangles;
}

// Round a new point at the border's centre. Nothing: not every edge sees it.
std::optional<std::vector<Corners>> fan(const Polygon& polygon, std::int32_t centre) {
  std::vector<Corners> triangles;
  for (std::size_t i = 0; i < polygon.points.size(); ++i) {
    const std::size_t next = (i + 1) % polygon.points.size();
    if (!(cross(polygon.flat[i], polygon.flat[next]) > 0)) return {};  // the centre is the plane's origin
    triangles.push_back({polygon.points[i], polygon.points[next], centre});
  }
  return triangles;
}

// Of the triangles as they are, open shells turned inside out counted as if they were not.
double winding(const Draft& draft, const Vec3& p) {
  const double angle = parallel_reduce(
      draft.size(), 0.0,
      [&](std::size_t t) {
        const Corners& c = draft.triangles[t];
        return solid_angle(p, at(draft, c[0]), at(draft, c[1]), at(draft, c[2]));
      },
      [](double a, double b) { return a + b; });
  return std::abs(angle / (4 * std::numbers::pi));
}

double area_of(const Draft& draft, std::size_t t) {
  const Corners& c = draft.triangles[t];
  return 0.5 * (at(draft, c[1]) - at(draft, c[0])).cross(at(draft, c[2]) - at(draft, c[0])).norm();
}

// A cap parts what is inside from what is outside: the half level of the winding number, which closes all other openings, is there too.
bool is_wall(const Draft& draft, const std::vector<Corners>& cap, const Rim& rim) {
  const auto twice_area = [&](const Corners& c) {
    return (at(draft, c[1]) - at(draft, c[0])).cross(at(draft, c[2]) - at(draft, c[0])).norm();
  };
  const Corners& c =
      *std::max_element(cap.begin(), cap.end(), [&](const Corners& a, const Corners& b) { return twice_area(a) < twice_area(b); });
  const Vec3 centre = (at(draft, c[0]) + at(draft, c[1]) + at(draft, c[2])) / 3;
  const Vec3 aside = (rim.is_flat() ? kAside * std::sqrt(twice_area(c)) : kAsideBent * rim.size()) * rim.area.normalized();
  return (winding(draft, centre + aside) - 0.5) * (winding(draft, centre - aside) - 0.5) < 0;
}

// The patch with most edges on the border, the first of several.
std::int32_t patch_of(const Draft& draft, const Rim& rim) {
  std::vector<std::int32_t> patches;
  for (std::int32_t t : rim.triangles) patches.push_back(draft.patch[static_cast<std::size_t>(t)]);
  std::sort(patches.begin(), patches.end());
  std::int32_t best = patches.front();
  std::ptrdiff_t most = 0;
  for (auto first = patches.begin(); first != patches.end();) {
    const auto stop = std::upper_bound(first, patches.end(), *first);
    if (stop - first > most) most = stop - first, best = *first;
    first = stop;
  }
  return best;
}

}  // namespace

Repair cap_openings(Draft& draft) {
  Repair repair;
  std::vector<Rim> rims = rims_of(draft);
  if (rims.empty()) return repair;
  const std::vector<std::int32_t> shell = components(draft.triangles, sorted_sides(draft.triangles));
  std::vector<double> area(1 + static_cast<std::size_t>(*std::max_element(shell.begin(), shell.end())), 0);
  for (std::size_t t = 0; t < draft.size(); ++t) area[static_cast<std::size_t>(shell[t])] += area_of(draft, t);
  const auto shell_of = [&](const Rim& rim) { return static_cast<std::size_t>(shell[static_cast<std::size_t>(rim.triangles.front())]); };

  // The largest first: what lies inside it and runs the other way is an island that its cap leaves out.
  std::sort(rims.begin(), rims.end(), [](const Rim& a, const Rim& b) {
    const double x = a.area.norm(), y = b.area.norm();
    return x != y ? x > y : a.points.front() < b.points.front();
  });
  std::vector<char> taken(rims.size(), 0);
  std::size_t looks = 0;
  std::vector<std::pair<std::size_t, std::vector<Corners>>> caps;  // of rims
  for (std::size_t r = 0; r < rims.size(); ++r) {
    if (taken[r]) continue;
    const Rim& rim = rims[r];
    const Plane plane(rim);
    Polygon polygon = plane.polygon(draft, rim);
    const std::vector<Point2> border = polygon.flat;
    double cap_area = rim.area.norm(), whole = area[shell_of(rim)];
    std::vector<std::size_t> islands;
    for (std::size_t i = r + 1; i < rims.size() && rims.size() <= kMostWithIslands && rim.is_flat(); ++i) {
      const Rim& island = rims[i];
      const bool same_plane = island.is_flat() && -island.area.normalized().dot(rim.area.normalized()) > kSamePlane &&
                              std::abs((island.centre - rim.centre).dot(rim.area.normalized())) < kFlat * rim.size();
      if (taken[i] || !same_plane || !holds(border, plane.flat(at(draft, island.points.front())))) continue;
      if (!join(polygon, plane.polygon(draft, island))) continue;
      islands.push_back(i);
      cap_area -= island.area.norm();
      if (shell_of(island) != shell_of(rim)) whole += area[shell_of(island)];
    }
    if (cap_area > kMostOpen * (whole + cap_area)) continue;
    const bool is_tiny = cap_area < kTiny * whole;
    looks += is_tiny ? 0 : 2 * draft.size();
    if (looks > kMostLooks) continue;
    const auto centre = static_cast<std::int32_t>(draft.points.size());
    draft.points.push_back(rim.centre);
    std::optional<std::vector<Corners>> cap = rim.is_flat() ? triangulated(std::move(polygon)) : fan(polygon, centre);
    if (!cap || cap->empty() || (!is_tiny && !is_wall(draft, *cap, rim))) continue;
    taken[r] = 1;
    for (std::size_t i : islands) taken[i] = 1;
    caps.emplace_back(r, std::move(*cap));
  }
  for (const auto& [r, cap] : caps) {
    const Rim& rim = rims[r];
    const std::int32_t patch = patch_of(draft, rim);
    for (const Corners& c : cap) {
      draft.triangles.push_back(c);
      draft.patch.push_back(patch);
      draft.source.push_back(draft.source[static_cast<std::size_t>(rim.triangles.front())]);
    }
    ++repair.count;
    for (std::int32_t p : rim.points) repair.box.add(at(draft, p));
    for (std::int32_t t : rim.triangles) repair.triangles.push_back(draft.source[static_cast<std::size_t>(t)]);
  }
  return repair;
}

}  // namespace strata
