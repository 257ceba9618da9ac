#include "core/octree/target_levels.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace strata {
namespace {

constexpr double kLevelSlack = 1e-9;  // of a level: sizes that are equal but for rounding must not cost a level

double bounded(double size, const SizeField& sizes) { return std::max(std::min(size, sizes.max_size), sizes.min_size); }

double doubled_area(const std::array<Vec3, 3>& c) { return (c[1] - c[0]).cross(c[2] - c[0]).norm(); }

// The size (up to powers of two) that the most quads will want: the root is a power of two times it.
double reference_size(const Surface& surface, const SizeField& sizes) {
  constexpr std::size_t kBins = 64;  // of one octave
  std::array<double, kBins> quads{};
  std::array<double, kBins> smallest;
  smallest.fill(std::numeric_limits<double>::infinity());
  for (const TriangleId t : surface.triangles.ids()) {
    const double size = bounded(sizes.at_triangle[t], sizes);
    const double octave = std::log2(size);
    const auto bin = static_cast<std::size_t>((octave - std::floor(octave)) * kBins) % kBins;
    quads[bin] += doubled_area(surface.corners(t)) / (size * size);
    smallest[bin] = std::min(smallest[bin], size);
  }
  return smallest[static_cast<std::size_t>(std::max_element(quads.begin(), quads.end()) - quads.begin())];
}

double coarsest_at_surface(const SizeField& sizes) {
  double coarsest = 0;
  for (const double size : sizes.at_triangle) coarsest = std::max(coarsest, bounded(size, sizes));
  return coarsest;
}

}  // namespace

RootCube choose_root(const Surface& surface, const SizeField& sizes, double coarsening) {
  constexpr double kMarginCells = 4;  // two blocks of the coarsest size met at the surface, on either side
  const double reference = coarsening * reference_size(surface, sizes);
  const double margin = kMarginCells * coarsening * coarsest_at_surface(sizes);
  const double least = surface.box.extent().maxCoeff() + 2 * margin;
  RootCube root;
  root.size = std::ldexp(reference, static_cast<int>(std::ceil(std::log2(least / reference) - kLevelSlack)));
  root.origin = surface.box.centre() - Vec3::Constant(0.5 * root.size);
  return root;
}

int level_of(double size, const TargetLevels& targets) {
  return std::clamp(static_cast<int>(std::round(targets.of_unit_size - std::log2(size))), 0, targets.finest);
}

TargetLevels target_levels(const Surface& surface, const SizeField& sizes, double coarsening, double root_size, int finest_level) {
  TargetLevels levels;
  const auto exact = [&](double size) { return std::log2(root_size / (2 * coarsening * size)); };
  const auto clamped = [&](double level) {
    if (level > finest_level) levels.clamped = true;
    return std::clamp(static_cast<int>(level), 0, finest_level);
  };
  levels.finest = finest_level;
  levels.of_unit_size = exact(1);
  levels.inside_box = clamped(std::ceil(exact(sizes.max_size) - kLevelSlack));
  const auto nearest = [&](double size) {
    return static_cast<std::uint8_t>(std::max(levels.inside_box, clamped(std::round(exact(bounded(size, sizes))))));
  };
  levels.of_triangle.reserve(surface.triangles.size());
  for (const double size : sizes.at_triangle) levels.of_triangle.push_back(nearest(size));
  for (const SizedSegment& segment : sizes.segments) levels.of_triangle.push_back(nearest(segment.size));
  for (const SizeSource& source : sizes.sources) levels.of_source.push_back(nearest(source.size));
  return levels;
}

}  // namespace strata
