#include "bench/shapes/blade.h"

#include <cmath>
#include <numbers>

namespace strata::shapes {

Section part_of(const Section& section, int first, int last) {
  return {part_of(section.low, first, last), part_of(section.high, first, last)};
}

Row outline_of(const Section& section) {
  Row loop(section.high.rbegin(), section.high.rend());
  loop.insert(loop.end(), section.low.begin() + 1, section.low.end() - 1);
  return loop;
}

void add_blade(PatchedSurface& surface, const std::vector<Section>& sections, int patch) {
  for (std::size_t s = 0; s + 1 < sections.size(); ++s) {
    add_strip(surface, sections[s].high, sections[s + 1].high, patch);
    add_strip(surface, sections[s + 1].low, sections[s].low, patch);
  }
}

void add_round_tip(PatchedSurface& surface, const Section& tip, const Point& outward, int segments, int patch) {
  Row last = tip.high;
  for (int k = 1; k <= segments; ++k) {
    const double angle = std::numbers::pi * k / segments;
    Row next = tip.low;
    for (std::size_t i = 1; k < segments && i + 1 < next.size(); ++i) {
      const Point high = surface.points[tip.high[i]], low = surface.points[tip.low[i]];
      const double radius = std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) / 2;
      Point place = between(low, high, (1 + std::cos(angle)) / 2);
      for (int d = 0; d < 3; ++d) place[d] += outward[d] * radius * std::sin(angle);
      next[i] = surface.add_point(place);
    }
    add_strip(surface, last, next, patch);
    last = std::move(next);
  }
}

double half_thickness(double u, double thickness) {
  // Abbott and von Doenhoff, Theory of Wing Sections, with the last coefficient that closes the trailing edge.
  return 5 * thickness * (0.2969 * std::sqrt(u) + u * (-0.1260 + u * (-0.3516 + u * (0.2843 - u * 0.1036))));
}

std::vector<double> chord_stations(int n) {
  std::vector<double> stations;
  for (int i = 0; i <= n; ++i) stations.push_back(i == n ? 1 : 1 - std::cos(std::numbers::pi / 2 * i / n));
  return stations;
}

std::vector<double> round_stations(int n) {
  std::vector<double> stations;
  for (int i = 0; i <= n; ++i) stations.push_back(i == n ? 1 : (1 - std::cos(std::numbers::pi * i / n)) / 2);
  return stations;
}

Point on_profile(const Profile& profile, double u, int side) {
  const double half = u == 1 ? 0 : side * profile.chord * half_thickness(u, profile.thickness);
  Point p = profile.front;
  p[0] += u * profile.chord;
  for (int d = 0; d < 3; ++d) p[d] += half * profile.normal[d];
  return p;
}

Section add_section(PatchedSurface& surface, const Profile& profile, const std::vector<double>& stations) {
  std::vector<Point> low, high;
  for (const double u : stations) {
    low.push_back(on_profile(profile, u, -1));
    high.push_back(on_profile(profile, u, +1));
  }
  const Row row = add_row(surface, low);
  return {row, split_row(surface, row, 0, static_cast<int>(stations.size()) - 1, high)};
}

void StraightBlade::add(PatchedSurface& surface, const Point& outward, int span, int round, int patch) const {
  std::vector<Section> sections = {root_};
  for (int s = 1; s <= span; ++s) {
    const double up = s == span ? 1 : static_cast<double>(s) / span;
    sections.push_back(section(surface, [&](int, int) { return up; }));
  }
  add_blade(surface, sections, patch);
  add_round_tip(surface, sections.back(), outward, round, patch);
}

}  // namespace strata::shapes
