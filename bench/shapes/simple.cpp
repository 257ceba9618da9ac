// Cube, cylinder, ball, and a ball in a box.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "bench/shapes/primitives.h"
#include "bench/shapes/shapes.h"

namespace strata::shapes {

namespace {

std::vector<double> full_turn(int segments) {
  auto angles = steps(0, 2 * std::numbers::pi, segments);
  angles.pop_back();
  return angles;
}

void add_revolved(PatchedSurface& surface, const std::vector<ProfilePoint>& profile, const std::vector<double>& angles) {
  const auto grid = add_revolved_points(surface, profile, angles);
  for (int i = 0; i + 1 < static_cast<int>(profile.size()); ++i) {
    add_band(surface, grid, i, 0, static_cast<int>(angles.size()), surface.patch(profile[i].patch));
  }
}

std::vector<ProfilePoint> ball_profile(double radius, int segments) {
  std::vector<ProfilePoint> profile;
  for (const double angle : steps(0, std::numbers::pi, segments)) {
    profile.push_back({-radius * std::cos(angle), radius * std::sin(angle), "sphere"});
  }
  profile.front().r = profile.back().r = 0;
  return profile;
}

}  // namespace

PatchedSurface cube(int fineness) {
  PatchedSurface surface;
  add_box(surface, {0, 0, 0}, {1, 1, 1}, {"xmin", "xmax", "ymin", "ymax", "zmin", "zmax"}, 4 * fineness);
  return surface;
}

PatchedSurface cylinder(int fineness) {
  PatchedSurface surface;
  std::vector<ProfilePoint> profile;
  const int rings = 4 * fineness;
  for (const double r : steps(0, 0.5, rings)) profile.push_back({0, r, "front"});
  profile.back().patch = "side";
  for (const double x : steps(0, 2, 4 * rings)) {
    if (x > 0) profile.push_back({x, 0.5, "side"});
  }
  profile.back().patch = "back";
  for (const double r : steps(0.5, 0, rings)) {
    if (r < 0.5) profile.push_back({2, r, "back"});
  }
  add_revolved(surface, profile, full_turn(24 * fineness));
  turn_inside_out(surface);
  return surface;
}

PatchedSurface sphere(int fineness) {
  PatchedSurface surface;
  add_revolved(surface, ball_profile(0.5, 24 * fineness), full_turn(48 * fineness));
  turn_inside_out(surface);
  return surface;
}

PatchedSurface sphere_in_box(int fineness) {
  PatchedSurface surface;
  add_revolved(surface, ball_profile(0.5, 24 * fineness), full_turn(48 * fineness));
  turn_inside_out(surface);
  add_box(surface, {-3, -3, -3}, {3, 3, 3}, {"inlet", "outlet", "farfield", "farfield", "farfield", "farfield"}, 4);
  return surface;
}

const std::vector<Shape>& all_shapes() {
  static const std::vector<Shape> shapes = {
      {"cube", cube},     {"cylinder", cylinder}, {"sphere", sphere}, {"sphere_in_box", sphere_in_box},
      {"rocket", rocket}, {"fighter", fighter},   {"hull", hull},     {"mirror", mirror},
      {"wing", wing},     {"bracket", bracket}};
  return shapes;
}

}  // namespace strata::shapes
