// Wings, tails and feet: two sides that meet in a leading and a trailing edge.
#pragma once

#include <vector>

#include "bench/shapes/rows.h"

namespace strata::shapes {

// A section through a blade: its two sides from the leading to the trailing edge, where they share a point. Of the directions back, away
// from the root, and from low to high, the third is the cross product of the first two.
struct Section {
  Row low, high;
};
Section part_of(const Section& section, int first, int last);
Row outline_of(const Section& section);  // once round, from the trailing edge over the high side

// The sides between the sections, root first; normals point out of the blade.
void add_blade(PatchedSurface& surface, const std::vector<Section>& sections, int patch);
// The tip turned about the blade's middle: round between the sides, running out into the edges at either end. `outward` has length 1.
void add_round_tip(PatchedSurface& surface, const Section& tip, const Point& outward, int segments, int patch);

// Half the thickness of a symmetric wing section (NACA four digits with a closed, sharp trailing edge) at `u` of its chord from the
// leading edge; `thickness` and result in chords.
double half_thickness(double u, double thickness);
// From 0 to 1, close at the round leading edge and wide at the sharp trailing edge.
std::vector<double> chord_stations(int n);
// From 0 to 1, close at both ends, for sections that are round there.
std::vector<double> round_stations(int n);

// A wing section in space, its chord along x.
struct Profile {
  Point front;  // the leading edge
  double chord, thickness;
  Point normal;  // from low to high
};
Point on_profile(const Profile& profile, double u, int side);  // side: -1 low, +1 high
Section add_section(PatchedSurface& surface, const Profile& profile, const std::vector<double>& stations);

// The blade of straight lines from the root to the profile at the tip.
class StraightBlade {
 public:
  StraightBlade(Section root, const Profile& tip, std::vector<double> stations)
      : root_(std::move(root)), tip_(tip), stations_(std::move(stations)) {}

  // A section away from the root: up(i, side) tells how far at station i on the low (-1) or high (+1) side, 1 being the tip.
  template <typename Up>
  Section section(PatchedSurface& surface, Up&& up) const {
    const int last = static_cast<int>(stations_.size()) - 1;
    std::vector<Point> low, high;
    for (int i = 0; i <= last; ++i) {
      low.push_back(between(surface.points[root_.low[i]], on_profile(tip_, stations_[i], -1), up(i, -1)));
      high.push_back(between(surface.points[root_.high[i]], on_profile(tip_, stations_[i], +1), up(i, +1)));
    }
    const Row row = add_row(surface, low);
    return {row, split_row(surface, row, 0, last, high)};
  }

  // All of it, in `span` steps and with a round tip.
  void add(PatchedSurface& surface, const Point& outward, int span, int round, int patch) const;

  [[nodiscard]] const Section& root() const { return root_; }

 private:
  Section root_;
  Profile tip_;
  std::vector<double> stations_;
};

}  // namespace strata::shapes
