// The body of the jet fighter: a grid of rows from the middle of the intake to the middle of the exhaust, open where wings and tail stand.
#pragma once

#include <array>
#include <vector>

#include "bench/shapes/blade.h"
#include "bench/shapes/primitives.h"

namespace strata::shapes {

// What stands on the body, in the order of the angles from +y towards +z.
enum Stand { kRightWing, kTail, kLeftWing, kStands };

// The root of a blade: stations in chords from its leading edge.
struct Root {
  double front, chord, thickness;
  std::vector<double> stations;
};

class FighterBody {
 public:
  FighterBody(PatchedSurface& surface, const Root& wing, const Root& tail, int fineness);

  void fill();  // with the patches body, intake, exhaust
  [[nodiscard]] Section root(Stand stand) const;

 private:
  [[nodiscard]] const Root& root_at(int stand) const { return stand == kTail ? tail_ : wing_; }
  [[nodiscard]] int first(int stand) const { return stand == kTail ? first_of_tail_ : first_of_wing_; }
  [[nodiscard]] int last(int stand) const { return first(stand) + static_cast<int>(root_at(stand).stations.size()) - 1; }
  [[nodiscard]] double angle(int stand, int station, int side) const;
  [[nodiscard]] Section opening(int stand);
  [[nodiscard]] Row row_between(int stand, int k);
  [[nodiscard]] Row add_points(const std::vector<Point>& points);

  PatchedSurface& surface_;
  Root wing_, tail_;
  std::vector<ProfilePoint> outline_;
  int first_of_wing_ = 0, first_of_tail_ = 0;
  std::array<int, kStands> rows_between_;
  Row middle_;  // the points on the axis, which all rows share; -1 elsewhere
  std::vector<int> patches_;
  std::array<Section, kStands> sides_;
};

}  // namespace strata::shapes
