// What of the features a mesh can hold: curves chained into routes, creases too small for the cells left out.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/base/ids.h"
#include "core/base/vec3.h"
#include "core/optimise/ground.h"
#include "core/optimise/polyline.h"

namespace strata {

// One or several curves in a row that one path of mesh edges is to represent.
struct Route {
  std::vector<CurveId> curves;   // in order
  std::vector<Vec3> points;      // a closed route repeats its first point
  Polyline line;                 // the same, for questions
  bool closed = false;
  CornerId first, last;          // invalid: a closed route that passes no corner
  bool border = false;           // of a patch or of the surface, or non-manifold: matters more than a crease
  double length = 0;
  double size = 0;               // mean edge length of the mesh along it
};

struct RoutePlan {
  std::vector<Route> routes;                  // important ones first: borders, then creases, long before short
  IdMap<CurveId, std::uint8_t> contracted;    // 1: between corners that were united; the charts beside it stay two
  IdMap<CornerId, CornerId> stands_for;       // the corner that represents this one (often itself); invalid: none does
};

// Leaves out dangling creases much shorter than a cell, closed ones shorter than four, one side of strips much narrower than a cell;
// unites corners much closer than a cell; chains curves where the corner between them was made by what was left out.
// `size_at`: mesh edge length at a place.
// `let_go`: by curve, 1: left out from the start; may be empty.
RoutePlan plan_routes(const Ground& ground, const IdMap<CurveId, std::uint8_t>& let_go, const std::function<double(const Vec3&)>& size_at);

}  // namespace strata
