#include "core/wishes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace strata {
namespace {

constexpr double kDefaultCellsAcross = 16;  // default bound for cells: longest side of the bounding box over this

// One pattern: either side; two: both sides, either way round.
bool lies_between(const std::vector<std::string>& patterns, const std::string& left, const std::string& right) {
  if (patterns.size() == 1) return matches(patterns[0], left) || matches(patterns[0], right);
  return (matches(patterns[0], left) && matches(patterns[1], right)) || (matches(patterns[0], right) && matches(patterns[1], left));
}

IdMap<CurveId, double> curve_sizes(const MeshSpec& spec, const Surface& surface, const Features& features) {
  IdMap<CurveId, double> sizes;
  if (spec.sizing.curves.empty()) return sizes;
  sizes.assign(features.curves.size(), std::numeric_limits<double>::infinity());
  const auto patch_name = [&](ChartId chart) {
    return chart.valid() ? surface.patch_names[features.patch_of_chart[chart]] : std::string();
  };
  for (CurveId c : sizes.ids()) {
    const std::string left = patch_name(features.curves[c].left), right = patch_name(features.curves[c].right);
    for (const CurveSize& entry : spec.sizing.curves)
      if (lies_between(entry.between, left, right)) sizes[c] = std::min(sizes[c], entry.size);
  }
  return sizes;
}

}  // namespace

// The specification with its lengths and places in the working frame.
MeshSpec in_working_frame(MeshSpec spec, const Frame& frame) {
  const auto scale = [&](std::optional<double>& length) {
    if (length) *length *= frame.scale;
  };
  for (Vec3& p : spec.volume.points) p = frame.to_work(p);
  scale(spec.sizing.max_size);
  scale(spec.sizing.min_size);
  for (CurveSize& c : spec.sizing.curves) c.size *= frame.scale;
  if (spec.sizing.background) {
    SizeMap& map = *spec.sizing.background;
    map.min = frame.to_work(map.min);
    map.max = frame.to_work(map.max);
    for (double& size : map.sizes) size *= frame.scale;
  }
  for (PatchSize& s : spec.sizing.patches) s.size *= frame.scale;
  for (BoxSize& b : spec.sizing.boxes) b = {frame.to_work(b.min), frame.to_work(b.max), b.size * frame.scale};
  for (SphereSize& s : spec.sizing.spheres) s = {frame.to_work(s.centre), s.radius * frame.scale, s.size * frame.scale};
  for (CylinderSize& c : spec.sizing.cylinders)
    c = {frame.to_work(c.from), frame.to_work(c.to), c.radius * frame.scale, c.size * frame.scale};
  for (LayerSpec& l : spec.layers) {
    if (l.relative) continue;
    scale(l.first_height);
    scale(l.last_height);
    scale(l.total_thickness);
  }
  return spec;
}

SizeOptions size_options(const MeshSpec& spec, const Surface& surface, const Features& features) {
  SizeOptions options;
  const double longest = surface.longest_side;
  const auto at_level = [&](std::optional<int> level, double otherwise) { return level ? std::ldexp(longest, -*level) : otherwise; };
  options.max_size = spec.sizing.max_size.value_or(at_level(spec.sizing.min_level, longest / kDefaultCellsAcross));
  options.min_size = spec.sizing.min_size.value_or(at_level(spec.sizing.max_level, 0));
  options.patch_size.assign(surface.patch_names.size(), std::numeric_limits<double>::infinity());
  for (PatchId p : surface.patch_names.ids())
    for (const PatchSize& entry : spec.sizing.patches) {
      const auto names_it = [&](const std::string& pattern) { return matches(pattern, surface.patch_names[p]); };
      if (std::none_of(entry.patches.begin(), entry.patches.end(), names_it)) continue;
      options.patch_size[p] = entry.size;
      break;  // the first entry that matches rules
    }
  options.curvature = spec.sizing.curvature.value_or(0);
  options.gap_cells = spec.sizing.gap_cells.value_or(0);
  for (const BoxSize& b : spec.sizing.boxes) options.sources.push_back({SizeSource::Shape::Box, b.min, b.max, 0, b.size});
  for (const SphereSize& s : spec.sizing.spheres)
    options.sources.push_back({SizeSource::Shape::Sphere, s.centre, s.centre, s.radius, s.size});
  for (const CylinderSize& c : spec.sizing.cylinders)
    options.sources.push_back({SizeSource::Shape::Cylinder, c.from, c.to, c.radius, c.size});
  options.curve_size = curve_sizes(spec, surface, features);
  if (spec.sizing.background) {
    const SizeMap& map = *spec.sizing.background;
    options.grid = {map.min, map.max, {map.counts[0], map.counts[1], map.counts[2]}, map.sizes};
  }
  return options;
}

OctreeOptions octree_options(const MeshSpec& spec) {
  OctreeOptions options;
  options.max_cells = spec.sizing.max_cells.value_or(0);
  options.gradation = spec.sizing.gradation;
  return options;
}

FeatureOptions feature_options(const MeshSpec& spec) {
  return {.ridge_angle = spec.features.ridge_angle, .round_sharp = spec.features.sharp_edges == SharpEdges::Fillet};
}

}  // namespace strata
