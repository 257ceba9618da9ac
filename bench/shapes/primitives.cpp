#include "bench/shapes/primitives.h"

#include <cmath>
#include <map>

namespace strata::shapes {

namespace {

// The points of a box's faces, which share their edges.
class BoxGrid {
 public:
  BoxGrid(PatchedSurface& surface, const Point& low, const Point& high, int segments)
      : surface_(surface), low_(low), high_(high), segments_(segments) {}

  // Place (u, v) on a face, in an order that makes u cross v point out of the box.
  int operator()(int face, int u, int v) {
    const int axis = face / 2;
    const bool at_high = face % 2 == 1;
    std::array<int, 3> place{};
    place[axis] = at_high ? segments_ : 0;
    place[(axis + 1) % 3] = at_high ? u : v;
    place[(axis + 2) % 3] = at_high ? v : u;
    const auto [found, inserted] = ids_.try_emplace(place, 0);
    if (inserted) found->second = surface_.add_point(position(place));
    return found->second;
  }

  void fill(int face, int patch) {
    auto& at = *this;
    for (int u = 0; u < segments_; ++u) {
      for (int v = 0; v < segments_; ++v) {
        surface_.add_quad(at(face, u, v), at(face, u + 1, v), at(face, u + 1, v + 1), at(face, u, v + 1), patch);
      }
    }
  }

  std::vector<int> outline(int face) {
    auto& at = *this;
    const int n = segments_;
    std::vector<int> loop;
    for (int i = 0; i < n; ++i) loop.push_back(at(face, i, 0));
    for (int i = 0; i < n; ++i) loop.push_back(at(face, n, i));
    for (int i = n; i > 0; --i) loop.push_back(at(face, i, n));
    for (int i = n; i > 0; --i) loop.push_back(at(face, 0, i));
    return loop;
  }

 private:
  [[nodiscard]] Point position(const std::array<int, 3>& place) const {
    Point p;
    for (int i = 0; i < 3; ++i) p[i] = low_[i] + (high_[i] - low_[i]) * place[i] / segments_;
    return p;
  }

  PatchedSurface& surface_;
  Point low_, high_;
  int segments_;
  std::map<std::array<int, 3>, int> ids_;
};

}  // namespace

void add_box(PatchedSurface& surface, const Point& low, const Point& high, const std::array<std::string, 6>& names, int segments) {
  BoxGrid grid(surface, low, high, segments);
  for (int face = 0; face < 6; ++face) grid.fill(face, surface.patch(names[face]));
}

std::vector<int> add_open_box(PatchedSurface& surface, const Point& low, const Point& high, const std::array<std::string, 6>& names,
                              int segments, int open_face) {
  BoxGrid grid(surface, low, high, segments);
  for (int face = 0; face < 6; ++face) {
    if (face != open_face) grid.fill(face, surface.patch(names[face]));
  }
  return grid.outline(open_face);
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
