// One vertex: Newton steps on the energy of its star, and the way of held vertices to their ground. Private to the room.
#pragma once

#include "core/optimise/star.h"
#include "core/optimise/workspace.h"

namespace strata {

// The Newton step -H^-1 g within the freedom. H must be positive definite.
Vec3 newton_step(const Freedom& freedom, const Vec3& gradient, const Mat3& hessian);

struct DescentOptions {
  int exponent = 1;             // of u, see Star
  double eps = 0;               // regularisation while the star holds a bad hex
  double floor = 0.02;          // smallest scaled Jacobian a move may lead to, from above
  double draw_floor = 0.02;     // the same for steps towards the ground, which pay no heed to the energy
  int steps = 1;                // Newton steps at most; neighbours move too, so one is mostly enough
};

// Where the vertex should be, seen from where it is. Never makes a sound hex bad.
Vec3 descend(const Star& star, const Freedom& freedom, const Vec3& from, const DescentOptions& options);
// May the vertex of a star go to d, whatever the energy says? Sound hexes stay so, poor hexes do not become poorer.
bool acceptable(const Star& star, const Vec3& d, const DescentOptions& options);

// One visit of the general optimiser; true when the vertex moved noticeably or has still to reach its ground.
bool visit(Workspace& work, VertexId v, const Star& star, const DescentOptions& options, bool project);

inline constexpr double kStill = 1e-2;  // of the mean edge at the vertex: a smaller move is none

}  // namespace strata
