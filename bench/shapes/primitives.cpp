#include "bench/shapes/primitives.h"

#include <cmath>
#include <map>

namespace strata::shapes {

void add_box(PatchedSurface& surface, const Point& low, const Point& high, const std::array<std::string, 6>& names, int segments) {
  std::map<std::array<int, 3>, int> ids;  // grid place -> point, so that faces share their edges
  const auto point = [&](const std::array<int, 3>& place) {
    const auto [found, inserted] = ids.try_emplace(place, 0);
    if (inserted) {
      Point p;
      for (int i = 0; i < 3; ++i) p[i] = low[i] + (high[i] - low[i]) * place[i] / segments;
      found->second = surface.add_point(p);
    }
    return found->second;
  };
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
    const bool at_high = face % 2 == 1;
    const int patch = surface.patch(names[face]);
    for (int a = 0; a < segments; ++a) {
      for (int b = 0; b < segments; ++b) {
        const auto at = [&](int du, int dv) {
          std::array<int, 3> place{};
          place[axis] = at_high ? segments : 0;
          place[u] = a + du;
          place[v] = b + dv;
          return point(place);
        };
        if (at_high) {
          surface.add_quad(at(0, 0), at(1, 0), at(1, 1), at(0, 1), patch);
        } else {
          surface.add_quad(at(0, 0), at(0, 1), at(1, 1), at(1, 0), patch);
        }
      }
    }
  }
}

RevolvedGrid add_revolved_points(PatchedSurface& surface, const std::vector<ProfilePoint>& profile, const std::vector<double>& angles) {
  RevolvedGrid grid;
  for (const auto& [x, r, patch] : profile) {
    std::vector<int> ring;
    if (r == 0) {
      ring.assign(angles.size(), surface.add_point({x, 0, 0}));
    } else {
      for (const double angle : angles) ring.push_back(surface.add_point({x, r * std::cos(angle), r * std::sin(angle)}));
    }
    grid.push_back(std::move(ring));
  }
  return grid;
}

void add_band(PatchedSurface& surface, const RevolvedGrid& grid, int i, int from, int to, int patch) {
  const auto& near = grid[i];
  const auto& far = grid[i + 1];
  const int columns = static_cast<int>(near.size());
  for (int j = from; j < to; ++j) {
    const int next = (j + 1) % columns;
    surface.add_quad(near[j], far[j], far[next], near[next], patch);
  }
}

std::vector<double> steps(double a, double b, int n) {
  std::vector<double> values;
  for (int i = 0; i <= n; ++i) values.push_back(i == n ? b : a + (b - a) * i / n);
  return values;
}

}  // namespace strata::shapes
