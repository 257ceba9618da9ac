// Half a ship's hull up to the waterline, in the water: round bow, flat transom, and a keel that deepens into a skeg where the bottom rises.
//
//        z = 0   _____________________________________  free surface
//               (                                    |
//                \__________                     __--| transom           z ^
//                  hull     |-------------------'   |                      |
//                           |_________keel__________|                      '---> x
//
// The plane y = 0 is that of symmetry. The hull's rows run from bow to transom, from the keel line up to the waterline.
#include <array>
#include <cmath>
#include <numbers>

#include "bench/shapes/blade.h"
#include "bench/shapes/planar.h"
#include "bench/shapes/primitives.h"
#include "bench/shapes/shapes.h"

namespace strata::shapes {

namespace {

constexpr double kLength = 6, kHalfBeam = 0.45, kDraft = 0.28;
constexpr double kKeelFront = 1.9, kKeelBack = 5.5, kKeelHalfWidth = 0.05, kKeelDepth = 0.4;
constexpr Point kLow = {-6, 0, -4}, kHigh = {14, 6, 0};

double rounded(double u) { return u < 1 ? std::sqrt(u * (2 - u)) : 1; }  // a quarter of an ellipse, then flat
double eased(double u) { return u < 0 ? 0 : u * u * (3 - 2 * u); }

double half_beam(double x) { return kHalfBeam * rounded(x / 2.4) * (1 - 0.25 * eased((x - 3.4) / (kLength - 3.4))); }
double draft(double x) { return kDraft * rounded(x / 1.2) * (1 - 0.65 * eased((x - 3.4) / (kLength - 3.4))); }

// A section is a superellipse, an ellipse at the bow and fuller behind; `angle` runs from 0 at the keel line to a right angle at the water.
Point on_hull(double x, double angle) {
  const double power = 2 + 0.8 * eased(std::fmin(1, x / 3));
  const double across = std::sin(angle), down = angle < std::numbers::pi / 2 ? std::cos(angle) : 0;
  const double reach = std::pow(std::pow(across, power) + std::pow(down, power), -1 / power);
  return {x, half_beam(x) * reach * across, -draft(x) * reach * down};
}

double angle_of_width(double x, double width) {
  double low = 0, high = std::numbers::pi / 4;
  for (int i = 0; i < 60; ++i) (on_hull(x, (low + high) / 2)[1] < width ? low : high) = (low + high) / 2;
  return (low + high) / 2;
}

// Where the hull's rows have points, and the keel's half width there.
struct Stations {
  std::vector<double> x, width;
  int first = 0, last = 0;  // of the keel
};

Stations stations(int f) {
  Stations s;
  const auto add = [&](double x, double width) { s.x.push_back(x), s.width.push_back(width); };
  for (const double u : chord_stations(30 * f)) add(u * kKeelFront, 0);
  s.first = static_cast<int>(s.x.size()) - 1;
  const auto turn = steps(0, std::numbers::pi / 2, 2 + f);  // not many: the first step along x falls with the square of their number
  for (const double a : turn) {
    if (a > 0) add(kKeelFront + kKeelHalfWidth * (1 - std::cos(a)), kKeelHalfWidth * std::sin(a));
  }
  for (const double x : steps(s.x.back(), kKeelBack - kKeelHalfWidth, 36 * f)) {
    if (x > s.x.back()) add(x, kKeelHalfWidth);
  }
  for (const double a : turn) {
    if (a > 0) add(kKeelBack - kKeelHalfWidth * (1 - std::sin(a)), kKeelHalfWidth * std::cos(a));
  }
  s.x.back() = kKeelBack, s.width.back() = 0;
  s.last = static_cast<int>(s.x.size()) - 1;
  for (const double x : steps(kKeelBack, kLength, 6 * f)) {
    if (x > kKeelBack) add(x, 0);
  }
  return s;
}

// Rows of the hull from the keel line to the waterline; all begin at the same point of the bow.
std::vector<Row> add_hull(PatchedSurface& surface, const Stations& s, int fineness) {
  const int bow = surface.add_point({0, 0, 0});
  std::vector<Row> rows;
  const int count = 18 * fineness;
  for (int k = 0; k <= count; ++k) {
    Row row = {bow};
    for (std::size_t i = 1; i < s.x.size(); ++i) {
      const double from = s.width[i] > 0 ? angle_of_width(s.x[i], s.width[i]) : 0;
      row.push_back(
          surface.add_point(on_hull(s.x[i], k == count ? std::numbers::pi / 2 : from + (std::numbers::pi / 2 - from) * k / count)));
    }
    rows.push_back(std::move(row));
  }
  for (int k = 0; k < count; ++k) add_strip(surface, rows[k], rows[k + 1], surface.patch("hull"));
  return rows;
}

// Sides and bottom of the keel. Returns its outline in the plane of symmetry, from the hull at the front to the hull at the back.
Row add_keel(PatchedSurface& surface, const Row& keel_line, const Stations& s, int fineness) {
  const Row root = part_of(keel_line, s.first, s.last);
  const int patch = surface.patch("keel"), count = 6 * fineness;
  std::vector<Row> rows = {root};
  for (int k = 1; k <= count; ++k) {
    std::vector<Point> points;
    for (int i = s.first; i <= s.last; ++i) {
      const Point top = surface.points[keel_line[i]];
      points.push_back(between(top, {s.x[i], s.width[i], -kKeelDepth}, static_cast<double>(k) / count));
    }
    rows.push_back(add_row(surface, points));
    add_strip(surface, rows[k], rows[k - 1], patch);
  }
  std::vector<Point> middle;
  for (int i = s.first; i <= s.last; ++i) middle.push_back({s.x[i], 0, -kKeelDepth});
  const Row centre = split_row(surface, rows.back(), 0, s.last - s.first, middle);
  add_strip(surface, centre, rows.back(), patch);
  Row outline;
  for (int k = 0; k < count; ++k) outline.push_back(rows[k].front());
  append(outline, centre);
  for (int k = count - 1; k >= 0; --k) outline.push_back(rows[k].back());
  return outline;
}

// The lines in which the hull meets the planes: its outline on that of symmetry, transom included, from stern to bow; the waterline from
// bow to stern, transom included.
struct Lines {
  Row profile, waterline;
};

Lines add_transom(PatchedSurface& surface, const std::vector<Row>& hull, const Row& profile, int fineness) {
  StraightEdges edge(surface, 6 * fineness);
  const int top = surface.add_point({kLength, 0, 0});
  Row outline = edge(profile.back(), top);
  append(outline, edge(top, hull.back().back()));
  for (auto row = hull.rbegin(); row + 1 != hull.rend(); ++row) outline.push_back(row->back());
  add_planar(surface, outline, {}, surface.patch("transom"));
  Lines lines;
  lines.profile = edge(top, profile.back());
  append(lines.profile, reversed(profile));
  lines.waterline = hull.back();
  lines.waterline.pop_back();
  append(lines.waterline, edge(hull.back().back(), top));
  lines.waterline.push_back(top);
  return lines;
}

// Symmetry plane and free surface round the hull, and the rest of the water's bounds.
void add_water(PatchedSurface& surface, const Lines& lines) {
  StraightEdges edge(surface, 8);
  std::array<int, 8> c{};  // corners; bit 0: far in x, 1: in y, 2: in z
  for (int i = 0; i < 8; ++i)
    c[i] = surface.add_point({i & 1 ? kHigh[0] : kLow[0], i & 2 ? kHigh[1] : kLow[1], i & 4 ? kHigh[2] : kLow[2]});
  const int bow = lines.waterline.front(), stern = lines.waterline.back();

  Row symmetry = edge(c[4], c[0]);
  for (const auto& [a, b] : {std::pair(c[0], c[1]), std::pair(c[1], c[5]), std::pair(c[5], stern)}) append(symmetry, edge(a, b));
  append(symmetry, Row(lines.profile.begin(), lines.profile.end() - 1));
  append(symmetry, edge(bow, c[4]));
  add_planar(surface, symmetry, {}, surface.patch("symmetry"));

  Row water = edge(c[4], bow);
  append(water, Row(lines.waterline.begin(), lines.waterline.end() - 1));
  for (const auto& [a, b] : {std::pair(stern, c[5]), std::pair(c[5], c[7]), std::pair(c[7], c[6]), std::pair(c[6], c[4])})
    append(water, edge(a, b));
  add_planar(surface, water, {}, surface.patch("free_surface"));

  add_planar(surface, edge.through({c[0], c[4], c[6], c[2]}), {}, surface.patch("inlet"));
  add_planar(surface, edge.through({c[1], c[3], c[7], c[5]}), {}, surface.patch("outlet"));
  add_planar(surface, edge.through({c[2], c[6], c[7], c[3]}), {}, surface.patch("side"));
  add_planar(surface, edge.through({c[0], c[2], c[3], c[1]}), {}, surface.patch("bottom"));
}

}  // namespace

PatchedSurface hull(int fineness) {
  PatchedSurface surface;
  const auto s = stations(fineness);
  const auto rows = add_hull(surface, s, fineness);
  const auto& keel_line = rows.front();
  Row profile = part_of(keel_line, 0, s.first);
  profile.pop_back();
  append(profile, add_keel(surface, keel_line, s, fineness));
  append(profile, part_of(keel_line, s.last + 1, static_cast<int>(keel_line.size()) - 1));
  add_water(surface, add_transom(surface, rows, profile, fineness));
  return surface;
}

}  // namespace strata::shapes
