#include "bench/shapes/fighter_body.h"

#include <cmath>
#include <numbers>

namespace strata::shapes {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kLength = 10;
constexpr double kIntakeRadius = 0.32, kIntakeDepth = 0.5, kLipRadius = 0.08;
constexpr double kBodyRadius = 0.75, kTailRadius = 0.5;
constexpr double kExhaustRadius = 0.36, kExhaustDepth = 0.4;
constexpr double kCanopyFront = 1.7, kCanopyBack = 4.6, kCanopyHeight = 0.3, kCanopyHalfAngle = 0.85;

// Angles of the middles of what stands on the body; the right wing again at the end.
constexpr double kWingAngle = -10 * kPi / 180;
constexpr std::array<double, kStands + 1> kStandAngle = {kWingAngle, kPi / 2, kPi - kWingAngle, 2 * kPi + kWingAngle};

double smooth_step(double u) { return u * u * (3 - 2 * u); }

double outer_radius(double x) {
  constexpr double kFull = 3.4, kTaper = 6.2;
  const double lip = kIntakeRadius + 2 * kLipRadius;
  if (x < kFull) return lip + (kBodyRadius - lip) * smooth_step((x - kLipRadius) / (kFull - kLipRadius));
  if (x > kTaper) return kBodyRadius + (kTailRadius - kBodyRadius) * smooth_step((x - kTaper) / (kLength - kTaper));
  return kBodyRadius;
}

void add_outer(std::vector<ProfilePoint>& outline, const std::vector<double>& stations) {
  for (std::size_t i = 1; i < stations.size(); ++i) outline.push_back({stations[i], outer_radius(stations[i]), "body"});
}

void add_line(std::vector<ProfilePoint>& outline, double x, double r, int n, const std::string& next) {
  const auto start = outline.back();
  for (int i = 1; i <= n; ++i) {
    const double u = static_cast<double>(i) / n;
    outline.push_back({i == n ? x : start.x + u * (x - start.x), i == n ? r : start.r + u * (r - start.r), start.patch});
  }
  outline.back().patch = next;
}

void add_intake(std::vector<ProfilePoint>& outline, int fineness) {
  outline.push_back({kIntakeDepth, 0, "intake"});
  add_line(outline, kIntakeDepth, kIntakeRadius, 6 * fineness, "body");
  add_line(outline, kLipRadius, kIntakeRadius, 8 * fineness, "body");
  for (const double a : steps(0, kPi, 8 * fineness)) {
    if (a > 0) outline.push_back({kLipRadius * (1 - std::sin(a)), kIntakeRadius + kLipRadius * (1 - std::cos(a)), "body"});
  }
}

void add_exhaust(std::vector<ProfilePoint>& outline, int fineness) {
  add_line(outline, kLength, kExhaustRadius, 3 * fineness, "body");
  add_line(outline, kLength - kExhaustDepth, kExhaustRadius, 6 * fineness, "exhaust");
  add_line(outline, kLength - kExhaustDepth, 0, 6 * fineness, "exhaust");
}

std::vector<double> stations_along(const Root& root) {
  auto stations = root.stations;
  for (double& u : stations) u = root.front + u * root.chord;
  return stations;
}

double canopy(double x, double angle) {
  const double along = (x - kCanopyFront) / (kCanopyBack - kCanopyFront), across = (angle - kPi / 2) / kCanopyHalfAngle;
  if (along <= 0 || along >= 1 || std::abs(across) >= 1) return 0;
  const double rise = std::sin(kPi * std::sqrt(along)), round = std::cos(kPi / 2 * across);
  return kCanopyHeight * rise * rise * round * round;
}

Point on_body(const ProfilePoint& p, double angle) {
  const double r = p.r + canopy(p.x, angle);
  return {p.x, r * std::cos(angle), r * std::sin(angle)};
}

}  // namespace

FighterBody::FighterBody(PatchedSurface& surface, const Root& wing, const Root& tail, int fineness)
    : surface_(surface), wing_(wing), tail_(tail), rows_between_{16 * fineness, 16 * fineness, 24 * fineness} {
  add_intake(outline_, fineness);
  add_outer(outline_, steps(kLipRadius, wing.front, 40 * fineness));
  first_of_wing_ = static_cast<int>(outline_.size()) - 1;
  add_outer(outline_, stations_along(wing));
  add_outer(outline_, steps(wing.front + wing.chord, tail.front, 10 * fineness));
  first_of_tail_ = static_cast<int>(outline_.size()) - 1;
  add_outer(outline_, stations_along(tail));
  add_outer(outline_, steps(tail.front + tail.chord, kLength, 8 * fineness));
  add_exhaust(outline_, fineness);
  for (const auto& p : outline_) {
    middle_.push_back(p.r == 0 ? surface.add_point({p.x, 0, 0}) : -1);
    patches_.push_back(surface.patch(p.patch));
  }
  for (int stand = 0; stand < kStands; ++stand) sides_[stand] = opening(stand);
}

void FighterBody::fill() {
  for (int stand = 0; stand < kStands; ++stand) {
    Row last = sides_[stand].high;
    for (int k = 1; k <= rows_between_[stand]; ++k) {
      Row next = k < rows_between_[stand] ? row_between(stand, k) : sides_[(stand + 1) % kStands].low;
      add_strip(surface_, next, last, patches_);
      last = std::move(next);
    }
  }
}

Section FighterBody::root(Stand stand) const { return part_of(sides_[stand], first(stand), last(stand)); }

// Of a side of the stand at a station: that of the middle, and within the opening half the blade's thickness beside it.
double FighterBody::angle(int stand, int station, int side) const {
  const double middle = kStandAngle[stand];
  const int of = stand % kStands;
  if (station <= first(of) || station >= last(of)) return middle;
  const auto& root = root_at(of);
  const double half = root.chord * half_thickness(root.stations[station - first(of)], root.thickness) / outline_[station].r;
  if (of == kTail) return middle + side * std::asin(half);
  const double mirror = of == kLeftWing ? -1 : 1;  // the wings are each other's mirror images
  return middle + mirror * (std::asin(std::sin(kWingAngle) + side * mirror * half) - kWingAngle);
}

Section FighterBody::opening(int stand) {
  std::vector<Point> low, high;
  for (int i = 0; i < static_cast<int>(outline_.size()); ++i) {
    low.push_back(on_body(outline_[i], angle(stand, i, -1)));
    high.push_back(on_body(outline_[i], angle(stand, i, +1)));
  }
  const Row row = add_points(low);
  return {row, split_row(surface_, row, first(stand), last(stand), high)};
}

Row FighterBody::row_between(int stand, int k) {
  const double u = static_cast<double>(k) / rows_between_[stand];
  std::vector<Point> points;
  for (int i = 0; i < static_cast<int>(outline_.size()); ++i) {
    const double from = angle(stand, i, +1), to = angle(stand + 1, i, -1);
    points.push_back(on_body(outline_[i], from + u * (to - from)));
  }
  return add_points(points);
}

Row FighterBody::add_points(const std::vector<Point>& points) {
  Row row = middle_;
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (row[i] < 0) row[i] = surface_.add_point(points[i]);
  }
  return row;
}

}  // namespace strata::shapes
