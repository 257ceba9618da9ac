// The flow around a car's side mirror: a rounded housing, its glass recessed behind a flat rim, on a foot that stands on a plate of a wall.
//
//             .--------. rim                    z ^
//        ___.'         |_                         |
//       (   housing     _|  glass (recessed)      '---> x (stream)
//        '---.__     __.|
//               |foot|
//      ________/______\_______ plate, wall
#include <cmath>
#include <numbers>

#include "bench/shapes/blade.h"
#include "bench/shapes/planar.h"
#include "bench/shapes/primitives.h"
#include "bench/shapes/shapes.h"

namespace strata::shapes {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kHalfWidth = 0.26, kHalfHeight = 0.17, kHeight = 0.42;  // of the housing; of its axis above the wall
constexpr double kFront = -0.22, kBack = 0.06, kRim = 0.87, kRecess = 0.04;
constexpr double kPower = 2.6;  // of the superellipses that are its sections
constexpr double kFootFront = -0.13, kFootLength = 0.16, kFootHalfWidth = 0.035;
constexpr double kFootSpread = 1.6;  // how much larger the foot is on the plate

Point on_housing(double x, double scale, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  const double reach = scale * std::pow(std::pow(std::abs(c), kPower) + std::pow(std::abs(s), kPower), -1 / kPower);
  return {x, kHalfWidth * reach * c, kHeight + kHalfHeight * reach * s};
}

double foot_half_width(double u) { return kFootHalfWidth * 2 * std::sqrt(u * (1 - u)); }

// From the middle of the front over housing, rim and recess to the middle of the glass; r is the scale of the section.
struct Outline {
  std::vector<ProfilePoint> profile;
  int foot = 0;  // the station where the foot begins
};

double scale_at(double x) { return x < 0 ? std::sqrt(1 - x * x / (kFront * kFront)) : 1; }

Outline outline(int f, const std::vector<double>& foot) {
  Outline result;
  auto& p = result.profile;
  for (const double a : steps(0, std::acos(kFootFront / kFront), 14 * f)) p.push_back({kFront * std::cos(a), std::sin(a), "housing"});
  p.front().r = 0;
  result.foot = static_cast<int>(p.size()) - 1;
  for (const double u : foot) {
    const double x = kFootFront + u * kFootLength;
    if (u > 0) p.push_back({x, scale_at(x), "housing"});
  }
  const auto add = [&](double x, double r, int n, const std::string& next) {
    const auto start = p.back();
    for (int i = 1; i <= n; ++i) p.push_back({start.x + (x - start.x) * i / n, start.r + (r - start.r) * i / n, start.patch});
    p.back().patch = next;
  };
  add(kBack, 1, 3 * f, "rim");
  add(kBack, kRim, 3 * f, "rim");
  add(kBack - kRecess, kRim, 4 * f, "glass");
  add(kBack - kRecess, 0, 12 * f, "");
  p.back().r = 0;
  return result;
}

// The angle beside the lowest line of the housing at which it is as wide as the foot.
double foot_angle(const ProfilePoint& p, double half_width) {
  double low = 0, high = kPi / 4;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (on_housing(p.x, p.r, middle - kPi / 2)[1] < half_width ? low : high) = middle;
  }
  return (low + high) / 2;
}

// The housing from one side of the foot round to the other. Returns the foot's root.
Section add_housing(PatchedSurface& surface, const Outline& line, const std::vector<double>& foot, int fineness) {
  const int stations = static_cast<int>(line.profile.size()), count = 64 * fineness, last = line.foot + static_cast<int>(foot.size()) - 1;
  const int front = surface.add_point({kFront, 0, kHeight}), back = surface.add_point({kBack - kRecess, 0, kHeight});
  std::vector<int> patches;
  for (const auto& p : line.profile) patches.push_back(surface.patch(p.patch.empty() ? "glass" : p.patch));
  std::vector<Row> rows;
  for (int k = 0; k <= count; ++k) {
    std::vector<Point> points;
    for (int i = 0; i < stations; ++i) {
      const auto& p = line.profile[i];
      const double half = i > line.foot && i < last ? foot_angle(p, foot_half_width(foot[i - line.foot])) : 0;
      points.push_back(p.r == 0 ? Point{} : on_housing(p.x, p.r, -kPi / 2 + half + (2 * kPi - 2 * half) * k / count));
    }
    Row row = k < count ? Row(stations, front) : split_row(surface, rows.front(), line.foot, last, points);
    for (int i = 1; i + 1 < stations && k < count; ++i) row[i] = surface.add_point(points[i]);
    row.back() = back;
    rows.push_back(std::move(row));
  }
  for (int k = 0; k < count; ++k) add_strip(surface, rows[k + 1], rows[k], patches);
  return {part_of(rows.back(), line.foot, last), part_of(rows.front(), line.foot, last)};
}

// Sections from the housing down to the plate, spreading. Returns the last.
Section add_foot(PatchedSurface& surface, const Section& root, const std::vector<double>& stations, int fineness) {
  const int last = static_cast<int>(stations.size()) - 1, count = 12 * fineness;
  std::vector<Section> sections = {root};
  for (int k = 1; k <= count; ++k) {
    std::vector<Point> low, high;
    for (int i = 0; i <= last; ++i) {
      const double x = kFootFront + kFootLength * (0.5 + kFootSpread * (stations[i] - 0.5));
      const double y = kFootSpread * foot_half_width(stations[i]), down = static_cast<double>(k) / count;
      low.push_back(between(surface.points[root.low[i]], {x, -y, 0}, down));
      high.push_back(between(surface.points[root.high[i]], {x, y, 0}, down));
      if (k == count) low.back()[2] = high.back()[2] = 0;
    }
    const Row row = add_row(surface, low);
    sections.push_back({row, split_row(surface, row, 0, last, high)});
  }
  add_blade(surface, sections, surface.patch("foot"));
  return sections.back();
}

// A rectangle with round corners on the wall, clockwise seen from the flow.
Row add_plate_outline(PatchedSurface& surface, int fineness) {
  constexpr double kHalfLength = 0.32, kHalfBreadth = 0.2, kCorner = 0.08, kMiddle = -0.05;
  Row loop;
  const double corner[4][2] = {{1, 1}, {1, -1}, {-1, -1}, {-1, 1}};
  for (int k = 0; k < 4; ++k) {
    const double x = kMiddle + corner[k][0] * (kHalfLength - kCorner), y = corner[k][1] * (kHalfBreadth - kCorner);
    for (const double a : steps(kPi / 2 * (1 - k), -kPi / 2 * k, 6 * fineness)) {
      loop.push_back(surface.add_point({x + kCorner * std::cos(a), y + kCorner * std::sin(a), 0}));
    }
  }
  return loop;
}

}  // namespace

PatchedSurface mirror(int fineness) {
  PatchedSurface surface;
  const auto foot = round_stations(16 * fineness);
  const auto root = add_housing(surface, outline(fineness, foot), foot, fineness);
  const auto footprint = outline_of(add_foot(surface, root, foot, fineness));
  turn_inside_out(surface);  // the mirror bounds the flow from inside
  const auto wall = add_open_box(surface, {-2, -1.5, 0}, {4, 1.5, 2}, {"inlet", "outlet", "sides", "sides", "wall", "top"}, 8, 4);
  const auto plate = add_plate_outline(surface, fineness);
  add_planar(surface, wall, {plate}, surface.patch("wall"));
  add_planar(surface, plate, {footprint}, surface.patch("plate"));
  return surface;
}

}  // namespace strata::shapes
