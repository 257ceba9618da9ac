// The flow around a rocket: a body of revolution about x whose grid has columns at the edges of the fins, so that the fins stand on
// points of the body and nothing needs to be cut.
//
//                              ____ tip
//                             /    |
//            nose        LE  /     | TE            r ^
//        __.-------.________/______|____              |
//      .'   ogive  |       body         |_base        '---> x
//     (  cap - - - - - - - - - - - - - -|_'-._ nozzle_outer
//                                         | '_| nozzle_lip
//                            nozzle_throat|_.'  nozzle_inner
#include <cmath>
#include <map>
#include <numbers>

#include "bench/shapes/primitives.h"
#include "bench/shapes/shapes.h"

namespace strata::shapes {

namespace {

constexpr double kRadius = 0.5;
constexpr double kNoseLength = 1.5;   // of the ogive before its tip is blunted
constexpr double kNoseRadius = 0.12;  // of the cap
constexpr double kBodyEnd = 5.0;
constexpr double kNozzleEnd = 5.6, kThroat = 5.2;
constexpr double kNozzleRootRadius = 0.22, kNozzleExitRadius = 0.40, kThroatRadius = 0.15, kLipWidth = 0.09;
constexpr double kFinThickness = 0.1;
constexpr double kFinRootFront = 3.6, kFinTipFront = 4.2, kFinBack = 4.7, kFinTipRadius = 1.2;
constexpr int kFins = 4;

struct Segments {
  int fin_thickness, between_fins, fin_span, fin_chord;
};
Segments segments(int fineness) { return {2 * fineness, 22 * fineness, 16 * fineness, 24 * fineness}; }

// Angles of the grid's columns, counted from the edge of fin 0: the thickness of a fin, the arc to the next, and so on.
std::vector<double> column_angles(const Segments& n) {
  const double quarter = 2 * std::numbers::pi / kFins;
  const double half_fin = std::asin(kFinThickness / 2 / kRadius);
  std::vector<double> angles;
  for (int fin = 0; fin < kFins; ++fin) {
    for (int k = 0; k < n.fin_thickness; ++k) {
      const double z = kFinThickness * (static_cast<double>(k) / n.fin_thickness - 0.5);
      angles.push_back(fin * quarter + std::asin(z / kRadius));
    }
    const auto arc = steps(fin * quarter + half_fin, (fin + 1) * quarter - half_fin, n.between_fins);
    angles.insert(angles.end(), arc.begin(), arc.end() - 1);
  }
  return angles;
}

// A tangent ogive blunted by a tangent cap; ends where the cylinder begins.
void add_nose(std::vector<ProfilePoint>& profile, int fineness) {
  const double rho = (kRadius * kRadius + kNoseLength * kNoseLength) / (2 * kRadius);  // of the ogive's arc
  const double centre = kNoseLength - std::sqrt(std::pow(rho - kNoseRadius, 2) - std::pow(rho - kRadius, 2));  // of the cap, on the axis
  const double tangent_r = kNoseRadius * (rho - kRadius) / (rho - kNoseRadius);
  const double cap_angle = std::asin(tangent_r / kNoseRadius);
  for (const double angle : steps(0, cap_angle, 5 * fineness)) {
    profile.push_back({centre - kNoseRadius * std::cos(angle), kNoseRadius * std::sin(angle), "nose"});
  }
  profile.front().r = 0;
  const double from = std::numbers::pi / 2 - cap_angle;  // angle of the ogive's normal from the radial direction
  for (const double angle : steps(from, 0, 32 * fineness)) {
    if (angle < from) profile.push_back({kNoseLength - rho * std::sin(angle), kRadius - rho + rho * std::cos(angle), "nose"});
  }
  profile.back() = {kNoseLength, kRadius, "body"};
}

// From the last point to (x, r) in n straight steps; the stretch that follows belongs to `next`.
void add_line(std::vector<ProfilePoint>& profile, double x, double r, int n, const std::string& next) {
  const auto start = profile.back();
  for (int i = 1; i <= n; ++i) {
    const double u = static_cast<double>(i) / n;
    profile.push_back({i == n ? x : start.x + u * (x - start.x), i == n ? r : start.r + u * (r - start.r), start.patch});
  }
  profile.back().patch = next;
}

// The same along a bell that starts and ends parallel to the axis.
void add_bell(std::vector<ProfilePoint>& profile, double x, double r, int n, const std::string& next) {
  const auto start = profile.back();
  for (int i = 1; i <= n; ++i) {
    const double u = static_cast<double>(i) / n;
    profile.push_back({i == n ? x : start.x + u * (x - start.x), i == n ? r : start.r + u * u * (3 - 2 * u) * (r - start.r), start.patch});
  }
  profile.back().patch = next;
}

struct Outline {
  std::vector<ProfilePoint> profile;
  int fin_front = 0;  // index of the profile point at the front of the fins' roots
};

Outline outline(int fineness, const Segments& n) {
  Outline result;
  auto& profile = result.profile;
  add_nose(profile, fineness);
  add_line(profile, kFinRootFront, kRadius, 48 * fineness, "body");
  result.fin_front = static_cast<int>(profile.size()) - 1;
  add_line(profile, kFinBack, kRadius, n.fin_chord, "body");
  add_line(profile, kBodyEnd, kRadius, 8 * fineness, "base");
  add_line(profile, kBodyEnd, kNozzleRootRadius, 8 * fineness, "nozzle_outer");
  add_bell(profile, kNozzleEnd, kNozzleExitRadius, 20 * fineness, "nozzle_lip");
  add_line(profile, kNozzleEnd, kNozzleExitRadius - kLipWidth, 3 * fineness, "nozzle_inner");
  add_bell(profile, kThroat, kThroatRadius, 16 * fineness, "nozzle_throat");
  add_line(profile, kThroat, 0, 5 * fineness, "");
  return result;
}

// One fin, standing on the body's points. Its grid: c from front to back, s from root to tip, k through the thickness.
class FinGrid {
 public:
  FinGrid(PatchedSurface& surface, const RevolvedGrid& body, int front, int fin, const Segments& n)
      : surface_(surface), body_(body), front_(front), fin_(fin), n_(n) {}

  int operator()(int c, int s, int k) {
    if (s == 0) return body_[front_ + c][root_column(k)];
    const auto [found, inserted] = ids_.try_emplace({c, s, k}, 0);
    if (inserted) found->second = surface_.add_point(place(c, s, k));
    return found->second;
  }

 private:
  [[nodiscard]] int root_column(int k) const { return fin_ * (n_.fin_thickness + n_.between_fins) + k; }

  [[nodiscard]] Point place(int c, int s, int k) const {
    const double along = static_cast<double>(c) / n_.fin_chord;
    const double up = static_cast<double>(s) / n_.fin_span;
    const double z = kFinThickness * (static_cast<double>(k) / n_.fin_thickness - 0.5);
    const double root_x = kFinRootFront + along * (kFinBack - kFinRootFront);
    const double tip_x = kFinTipFront + along * (kFinBack - kFinTipFront);
    const double root_y = std::sqrt(kRadius * kRadius - z * z);
    const double x = root_x + up * (tip_x - root_x);
    const double y = root_y + up * (kFinTipRadius - root_y);
    // Quarter turns by exchange, so that the four fins are alike to the last digit.
    switch (fin_) {
      case 0: return {x, y, z};
      case 1: return {x, -z, y};
      case 2: return {x, -y, -z};
      default: return {x, z, -y};
    }
  }

  PatchedSurface& surface_;
  const RevolvedGrid& body_;
  int front_, fin_;
  Segments n_;
  std::map<std::array<int, 3>, int> ids_;
};

void add_fin(PatchedSurface& surface, FinGrid point, const Segments& n) {
  const int patch = surface.patch("fins");
  const int chord = n.fin_chord, span = n.fin_span, thick = n.fin_thickness;
  for (int s = 0; s < span; ++s) {
    for (int c = 0; c < chord; ++c) {
      surface.add_quad(point(c, s, 0), point(c + 1, s, 0), point(c + 1, s + 1, 0), point(c, s + 1, 0), patch);
      surface.add_quad(point(c, s, thick), point(c, s + 1, thick), point(c + 1, s + 1, thick), point(c + 1, s, thick), patch);
    }
    for (int k = 0; k < thick; ++k) {
      surface.add_quad(point(0, s, k), point(0, s + 1, k), point(0, s + 1, k + 1), point(0, s, k + 1), patch);
      surface.add_quad(point(chord, s, k), point(chord, s, k + 1), point(chord, s + 1, k + 1), point(chord, s + 1, k), patch);
    }
  }
  for (int c = 0; c < chord; ++c) {
    for (int k = 0; k < thick; ++k) {
      surface.add_quad(point(c, span, k), point(c + 1, span, k), point(c + 1, span, k + 1), point(c, span, k + 1), patch);
    }
  }
}

}  // namespace

PatchedSurface rocket(int fineness) {
  const auto n = segments(fineness);
  const auto angles = column_angles(n);
  const auto [profile, fin_front] = outline(fineness, n);
  PatchedSurface surface;
  const auto grid = add_revolved_points(surface, profile, angles);
  const int period = n.fin_thickness + n.between_fins;
  for (int i = 0; i + 1 < static_cast<int>(profile.size()); ++i) {
    const int patch = surface.patch(profile[i].patch);
    const bool under_fins = i >= fin_front && i < fin_front + n.fin_chord;
    for (int fin = 0; fin < kFins; ++fin) {
      add_band(surface, grid, i, fin * period + (under_fins ? n.fin_thickness : 0), (fin + 1) * period, patch);
    }
  }
  for (int fin = 0; fin < kFins; ++fin) add_fin(surface, FinGrid(surface, grid, fin_front, fin, n), n);
  turn_inside_out(surface);
  add_box(surface, {-5, -6, -6}, {11, 6, 6}, {"inlet", "outlet", "farfield", "farfield", "farfield", "farfield"}, 4);
  return compact(surface);
}

}  // namespace strata::shapes
