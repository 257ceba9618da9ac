// The heights of layers from any sufficient set of count n, first a, last b, total T, growth r:
//   b = a r^(n-1),  T = a (1 + r + ... + r^(n-1)).
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/spec/mesh_spec.h"

namespace strata {
namespace {

constexpr double kAgree = 1e-3;      // relative: more given than needed must agree within this
constexpr double kGrowthDefault = 1.2;
constexpr int kMostLayers = 1000;
constexpr double kMostGrowth = 100;  // bracket of the solver; specifications above are refused by check()
constexpr int kBisections = 200;     // halves the bracket down to neighbouring doubles

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", value);
  return buffer;
}

[[noreturn]] void refuse(const std::string& field, const std::string& message) {
  Diagnostic d;
  d.reason = Reason::SpecInvalid;
  d.field = field;
  d.message = field + ": " + message;
  throw MeshError(Failure::InvalidInput, std::move(d));
}

double series(double r, int n) {
  double sum = 0;
  for (int i = n; i > 0; --i) sum = sum * r + 1;
  return sum;
}

// The root of an increasing function in [low, high]; nearest end when there is none.
template <class F>
double solve(double low, double high, const F& f) {
  for (int i = 0; i < kBisections; ++i) {
    const double middle = 0.5 * (low + high);
    (f(middle) < 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

bool near(double a, double b) { return std::abs(a - b) <= kAgree * std::max(std::abs(a), std::abs(b)); }

}  // namespace

ResolvedLayers resolve(const LayerSpec& s, const std::string& field) {
  ResolvedLayers out;
  const auto& n = s.count;
  const auto &a = s.first_height, &b = s.last_height, &total = s.total_thickness, &r = s.growth;
  const auto count_from = [&](double value) {
    if (!(value > 0.5) || !(value < kMostLayers + 0.5))
      refuse(field, "the heights give " + text(value) + " layers; at least 1 and at most " + std::to_string(kMostLayers) + " are possible");
    return static_cast<int>(std::lround(value));
  };
  if (n && *n == 0) return out;
  if (n) {
    out.count = *n;
    if (out.count < 0 || out.count > kMostLayers)
      refuse(field + ".count", std::to_string(*n) + " must lie between 0 and " + std::to_string(kMostLayers));
    const int k = out.count;
    if (a && (r || (!b && !total))) {
      out.first_height = *a;
      out.growth = r.value_or(kGrowthDefault);
    } else if (a && b) {
      out.first_height = *a;
      out.growth = k > 1 ? std::pow(*b / *a, 1.0 / (k - 1)) : 1;
    } else if (a && total) {
      out.first_height = *a;
      if (k > 1 && !(*total > *a)) refuse(field, "total_thickness " + text(*total) + " must exceed first_height " + text(*a));
      out.growth = k > 1 ? solve(0, kMostGrowth, [&](double x) { return *a * series(x, k) - *total; }) : 1;
    } else if (b && total && !r) {
      // Counted from the outermost layer inwards the ratio is 1 / r.
      if (k > 1 && !(*total > *b)) refuse(field, "total_thickness " + text(*total) + " must exceed last_height " + text(*b));
      const double back = k > 1 ? solve(0, kMostGrowth, [&](double x) { return *b * series(x, k) - *total; }) : 1;
      out.growth = 1 / back;
      out.first_height = *b * std::pow(back, k - 1);
    } else if (b) {
      out.growth = r.value_or(kGrowthDefault);
      out.first_height = *b / std::pow(out.growth, k - 1);
    } else if (total) {
      out.growth = r.value_or(kGrowthDefault);
      out.first_height = *total / series(out.growth, k);
    } else {
      refuse(field, "count needs one height: first_height, last_height or total_thickness");
    }
  } else if (a && b && total) {
    // T - a = r (T - b): both sums shifted by one.
    if (!(*total > *b) || !(*total >= *a)) refuse(field, "total_thickness " + text(*total) + " must exceed first_height and last_height");
    out.growth = (*total - *a) / (*total - *b);
    out.count = near(*a, *b) ? count_from(*total / *a) : count_from(1 + std::log(*b / *a) / std::log(out.growth));
    out.first_height = *a;
    out.growth = out.count > 1 ? std::pow(*b / *a, 1.0 / (out.count - 1)) : 1;
  } else if (a && b) {
    const double ratio = r.value_or(kGrowthDefault);
    if (near(ratio, 1) || *b < *a)
      refuse(field,
             "first_height " + text(*a) + ", last_height " + text(*b) + " and growth " + text(ratio) + " do not tell the count; give it");
    out.count = count_from(1 + std::log(*b / *a) / std::log(ratio));
    out.first_height = *a;
    out.growth = out.count > 1 ? std::pow(*b / *a, 1.0 / (out.count - 1)) : 1;
  } else if (a && total) {
    const double ratio = r.value_or(kGrowthDefault);
    out.count = count_from(near(ratio, 1) ? *total / *a : std::log1p(*total / *a * (ratio - 1)) / std::log(ratio));
    out.first_height = *total / series(ratio, out.count);  // the total is kept, the first height rounded to a whole count
    out.growth = ratio;
  } else if (b && total) {
    const double back = 1 / r.value_or(kGrowthDefault);
    const double left = 1 + *total / *b * (back - 1);
    if (!near(back, 1) && !(left > 0))
      refuse(field,
             "layers that grow by " + text(1 / back) + " to last_height " + text(*b) + " never sum to total_thickness " + text(*total));
    out.count = count_from(near(back, 1) ? *total / *b : std::log(left) / std::log(back));
    out.growth = 1 / back;
    out.first_height = *total / series(out.growth, out.count);
  } else {
    refuse(field, "give count, or two of first_height, last_height and total_thickness");
  }
  if (!std::isfinite(out.growth) || !(out.growth > 0) || !std::isfinite(out.first_height) || !(out.first_height > 0))
    refuse(field, "the heights cannot be met together");
  // What was given beyond need must agree; a count that was rounded keeps what it was computed from.
  if (!n) return out;
  const auto agree = [&](const std::optional<double>& wish, double got, const char* name) {
    if (wish && !near(*wish, got))
      refuse(field, std::string(name) + " " + text(*wish) + " contradicts the other values, which give " + text(got));
  };
  agree(a, out.first_height, "first_height");
  agree(b, out.height(out.count - 1), "last_height");
  agree(total, out.total(), "total_thickness");
  if (out.count > 1) agree(r, out.growth, "growth");
  return out;
}

}  // namespace strata
