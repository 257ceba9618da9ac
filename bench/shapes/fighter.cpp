// The flow around a jet fighter of the first generation: a round body with intake, canopy and exhaust, tapered wings, a swept tail, and a
// tail wing that stands on the tail. Wings and tail stand on openings of the body's rows, the tail wing on openings of the tail's.
//
//                                             ___ tail
//                                            /==/ tail wing           z ^
//                  canopy               ____/  /                        |
//        ________.-""-.________________/______/____                     |
//   intake (_____________ wing ____________________) exhaust            '---> x
#include <algorithm>

#include "bench/shapes/blade.h"
#include "bench/shapes/fighter_body.h"
#include "bench/shapes/primitives.h"
#include "bench/shapes/shapes.h"

namespace strata::shapes {

namespace {

constexpr double kTailTipHeight = 2.5;
constexpr double kTailWingHeight = 1.35, kTailWingThickness = 0.12;
constexpr double kTailWingFrom = 0.2, kTailWingTo = 0.85;  // where it stands, in chords of the tail

Profile wing_tip(double side) { return {{3.95, side * 6, 0.1}, 1.5, 0.12, {0, 0, side}}; }
Profile tail_tip() { return {{8.5, 0, kTailTipHeight}, 1.3, 0.12, {0, -1, 0}}; }

// The tail's stations and which of them the tail wing stands between.
struct TailStations {
  std::vector<double> u;
  int first = 0, last = 0;
};
TailStations tail_stations(int fineness) {
  TailStations stations;
  for (const double u : chord_stations(6 * fineness)) stations.u.push_back(kTailWingFrom * u);
  stations.first = static_cast<int>(stations.u.size()) - 1;
  for (const double u : chord_stations(14 * fineness)) {
    if (u > 0) stations.u.push_back(kTailWingFrom + u * (kTailWingTo - kTailWingFrom));
  }
  stations.last = static_cast<int>(stations.u.size()) - 1;
  for (const double u : steps(kTailWingTo, 1, 3 * fineness)) {
    if (u > kTailWingTo) stations.u.push_back(u);
  }
  return stations;
}

std::vector<double> tail_wing_stations(const TailStations& tail) {
  std::vector<double> stations;
  for (int i = tail.first; i <= tail.last; ++i) stations.push_back((tail.u[i] - kTailWingFrom) / (kTailWingTo - kTailWingFrom));
  stations.back() = 1;
  return stations;
}

class Tail {
 public:
  Tail(PatchedSurface& surface, const Section& root, const TailStations& stations, int fineness)
      : surface_(surface), blade_(root, tail_tip(), stations.u), stations_(stations), fineness_(fineness) {}

  void add() {
    const auto below = row_of_tail_wing(-1);
    const auto above = with_opening(below);
    add_below(below);
    add_above(above);
    const int first = stations_.first, last = stations_.last;  // the tail's low side is the right one
    right_ = {part_of(below.low, first, last), part_of(above.low, first, last)};
    left_ = {part_of(above.high, first, last), part_of(below.high, first, last)};
  }

  // The roots of the tail wing, after add().
  [[nodiscard]] const Section& right() const { return right_; }
  [[nodiscard]] const Section& left() const { return left_; }

 private:
  void add_below(const Section& top) {
    std::vector<Section> sections = {blade_.root()};
    const int n = 8 * fineness_;
    for (int s = 1; s < n; ++s) {
      sections.push_back(blade_.section(surface_, [&](int i, int side) { return height_of(i, side, -1) * s / n; }));
    }
    sections.push_back(top);
    add_blade(surface_, sections, surface_.patch("tail"));
  }

  void add_above(const Section& bottom) {
    std::vector<Section> sections = {bottom};
    const int n = 12 * fineness_;
    for (int s = 1; s <= n; ++s) {
      const double u = static_cast<double>(s) / n;
      sections.push_back(blade_.section(surface_, [&](int i, int side) { return s == n ? 1 : u + (1 - u) * height_of(i, side, +1); }));
    }
    add_blade(surface_, sections, surface_.patch("tail"));
    add_round_tip(surface_, sections.back(), {0, 0, 1}, 4 * fineness_, surface_.patch("tail"));
  }

  // How far up the tail the lower (-1) or upper (+1) face of the tail wing meets it; outside of the opening, the tail wing's middle.
  [[nodiscard]] double height_of(int i, int side, int face) const {
    const auto& root = side < 0 ? blade_.root().low : blade_.root().high;
    const double bottom = surface_.points[root[i]][2];
    double z = kTailWingHeight;
    if (i > stations_.first && i < stations_.last) {
      const double u = (stations_.u[i] - kTailWingFrom) / (kTailWingTo - kTailWingFrom);
      z += face * half_thickness(u, kTailWingThickness);  // the root is about 1 long
    }
    return (z - bottom) / (kTailTipHeight - bottom);
  }

  Section row_of_tail_wing(int face) {
    return blade_.section(surface_, [&](int i, int side) { return height_of(i, side, face); });
  }

  Section with_opening(const Section& below) {
    const auto upper = row_of_tail_wing(+1);
    Section above = below;
    for (int i = stations_.first + 1; i < stations_.last; ++i) above.low[i] = upper.low[i], above.high[i] = upper.high[i];
    return above;
  }

  PatchedSurface& surface_;
  StraightBlade blade_;
  TailStations stations_;
  int fineness_;
  Section right_, left_;
};

void add_tail_wing(PatchedSurface& surface, const Section& root, double side, const TailStations& tail, int fineness) {
  const double front = surface.points[root.low.front()][0];
  const Profile tip = {{front + 0.45, side * 2.2, kTailWingHeight}, 0.85, kTailWingThickness, {0, 0, side}};
  const StraightBlade blade(root, tip, tail_wing_stations(tail));
  blade.add(surface, {0, side, 0}, 16 * fineness, 4 * fineness, surface.patch("tail_wing"));
}

}  // namespace

PatchedSurface fighter(int fineness) {
  const auto stations = tail_stations(fineness);
  const Root wing = {3.5, 2.6, 0.12, chord_stations(20 * fineness)};
  const Root tail_root = {7.1, 2.3, 0.12, stations.u};
  PatchedSurface surface;
  FighterBody body(surface, wing, tail_root, fineness);
  body.fill();
  for (const Stand stand : {kRightWing, kLeftWing}) {
    const double side = stand == kRightWing ? 1 : -1;
    const StraightBlade blade(body.root(stand), wing_tip(side), wing.stations);
    blade.add(surface, {0, side, 0}, 30 * fineness, 4 * fineness, surface.patch("wing"));
  }
  Tail tail(surface, body.root(kTail), stations, fineness);
  tail.add();
  add_tail_wing(surface, tail.right(), +1, stations, fineness);
  add_tail_wing(surface, tail.left(), -1, stations, fineness);
  add_box(surface, {-12, -16, -14}, {24, 16, 14}, {"inlet", "outlet", "farfield", "farfield", "farfield", "farfield"}, 4);
  return compact(surface);
}

}  // namespace strata::shapes
