#include "core/layers/size_law.h"

#include <algorithm>
#include <cmath>

namespace strata {
namespace {

constexpr double kBlendingGoal = 0.5;       // of the cell above: paper section 4, no jump of more than two
constexpr double kMostBlendingGrowth = 2.0;
constexpr double kLeastBlendingRatio = 0.85;  // a blending layer thinner than the one under it wastes cells
constexpr double kExactEnough = 0.02;         // without blending layers, a thickness this near the wish is stretched over all layers

// h (1 + q + ... + q^(n-1))
double geometric_sum(double h, double q, int n) {
  double sum = 0;
  for (int i = 0; i < n; ++i, h *= q) sum += h;
  return sum;
}

// q with geometric_sum(h, q, n) = sum, bisected: the sum grows with q.
double ratio_for(double h, double sum, int n, double low, double high) {
  for (int i = 0; i < 60; ++i) {
    const double mid = 0.5 * (low + high);
    (geometric_sum(h, mid, n) < sum ? low : high) = mid;
  }
  return 0.5 * (low + high);
}

double last_height(const ColumnLaw& law) { return law.first_height * std::pow(law.growth, law.count - 1); }

}  // namespace

double physical_thickness(const ColumnLaw& law) { return geometric_sum(law.first_height, law.growth, law.count); }

int blending_layers(const ColumnLaw& law, double size) {
  const double last = last_height(law), goal = kBlendingGoal * size;
  if (last <= 0 || last >= goal) return 0;
  return static_cast<int>(std::ceil(std::log(goal / last) / std::log(kBlendingGrowth)));
}

double wished_thickness(const ColumnLaw& law, double size) {
  const double physical = physical_thickness(law);
  if (law.blending == 0) return physical;
  const double last = last_height(law);
  const double q = std::clamp(std::pow(std::max(kBlendingGoal * size / last, 1.0), 1.0 / law.blending), 1.0, kMostBlendingGrowth);
  return physical + geometric_sum(last * q, q, law.blending);
}

double least_thickness(const ColumnLaw& law) {
  return physical_thickness(law) + geometric_sum(last_height(law) * kLeastBlendingRatio, kLeastBlendingRatio, law.blending);
}

int count_that_fits(std::span<const ColumnLaw> laws, std::span<const double> room, int least, double share) {
  if (laws.empty()) return least;
  const auto fits = [&](int count) {
    std::size_t fitting = 0;
    for (std::size_t c = 0; c < laws.size(); ++c) {
      ColumnLaw law = laws[c];
      law.count = count;
      if (least_thickness(law) <= room[c]) ++fitting;
    }
    return static_cast<double>(fitting) >= share * static_cast<double>(laws.size());
  };
  int good = least, bad = laws.front().count + 1;
  while (bad - good > 1) {
    const int middle = (good + bad) / 2;
    (fits(middle) ? good : bad) = middle;
  }
  return good;
}

double column_fractions(const ColumnLaw& law, double thickness, std::span<double> levels) {
  const double wished = physical_thickness(law);
  double h = law.first_height, growth = law.growth;
  const double reserve = least_thickness(law) - wished;
  const bool near = law.blending == 0 && std::abs(thickness - wished) <= kExactEnough * wished;
  if (thickness < wished + reserve || near) {
    if (law.give_up_growth_first && !near && growth > 1) {
      const double room = thickness / (1 + reserve / wished);
      growth = room > geometric_sum(h, 1.0, law.count) ? ratio_for(h, room, law.count, 1.0, law.growth) : 1.0;
    }
    const double needed = geometric_sum(h, growth, law.count) * (1 + reserve / wished);
    if (needed > thickness || near) h *= thickness / needed;
  }
  const double physical = geometric_sum(h, growth, law.count);
  const auto total = static_cast<std::size_t>(law.count + law.blending);
  double level = 0, height = h;
  for (std::size_t i = 0; i < static_cast<std::size_t>(law.count); ++i, height *= growth) levels[i] = (level += height) / thickness;
  if (law.blending > 0) {
    height /= growth;
    const double rest = std::max(thickness - physical, 0.0);
    // Between the last physical layer and what is left: one ratio for all.
    const double q = ratio_for(height, rest + height, law.blending + 1, 0.01, 1e3);
    for (std::size_t i = static_cast<std::size_t>(law.count); i < total; ++i) levels[i] = (level += (height *= q)) / thickness;
  }
  levels[total - 1] = 1;
  return physical / wished;
}

}  // namespace strata
