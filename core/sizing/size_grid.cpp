#include <algorithm>
#include <cmath>
#include <limits>

#include "core/sizing/size_field.h"

namespace strata {
namespace {

struct Span {
  double low, high;  // in units of the grid's spacing, inside of it
};

double interpolated(const SizeGrid& grid, const std::array<double, 3>& at) {
  std::array<std::size_t, 3> base;
  std::array<double, 3> share;
  for (std::size_t k = 0; k < 3; ++k) {
    base[k] = std::min(static_cast<std::size_t>(at[k]), static_cast<std::size_t>(grid.counts[k] - 2));
    share[k] = at[k] - static_cast<double>(base[k]);
  }
  double sum = 0;
  for (std::size_t corner = 0; corner < 8; ++corner) {
    std::size_t node = 0;
    double weight = 1;
    for (std::size_t k = 3; k-- > 0;) {
      const std::size_t up = corner >> k & 1;
      node = node * static_cast<std::size_t>(grid.counts[k]) + base[k] + up;
      weight *= up != 0 ? share[k] : 1 - share[k];
    }
    sum += weight * grid.sizes[node];
  }
  return sum;
}

}  // namespace

double SizeGrid::smallest_in(const Vec3& low, double edge) const {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  if (sizes.empty()) return kNone;
  std::array<Span, 3> span;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    const double last = counts[k] - 1, unit = (max[axis] - min[axis]) / last;
    span[k] = {(low[axis] - min[axis]) / unit, (low[axis] + edge - min[axis]) / unit};
    if (span[k].high < 0 || span[k].low > last) return kNone;
    span[k] = {std::max(span[k].low, 0.0), std::min(span[k].high, last)};
  }
  // A trilinear function on a box is least at a corner: the span is cut at the nodes.
  std::array<std::vector<double>, 3> cuts;
  for (std::size_t k = 0; k < 3; ++k) {
    cuts[k].push_back(span[k].low);
    for (double node = std::floor(span[k].low) + 1; node < span[k].high; ++node) cuts[k].push_back(node);
    cuts[k].push_back(span[k].high);
  }
  double smallest = kNone;
  for (const double z : cuts[2])
    for (const double y : cuts[1])
      for (const double x : cuts[0]) smallest = std::min(smallest, interpolated(*this, {x, y, z}));
  return smallest;
}

}  // namespace strata
