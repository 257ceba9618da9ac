#include "core/wishes.h"

#include <algorithm>
#include <limits>
#include <string>

namespace strata {
namespace {

constexpr double kDefaultCellsAcross = 16;  // default bound for cells: longest side of the bounding box over this

}  // namespace

// The specification with its lengths and places in the working frame.
MeshSpec in_working_frame(MeshSpec spec, const Frame& frame) {
  const auto scale = [&](std::optional<double>& length) {
    if (length) *length *= frame.scale;
  };
  for (Vec3& p : spec.volume.points) p = frame.to_work(p);
  scale(spec.sizing.max_size);
  scale(spec.sizing.min_size);
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

SizeOptions size_options(const MeshSpec& spec, const Surface& surface) {
  SizeOptions options;
  options.max_size = spec.sizing.max_size.value_or(surface.box.extent().maxCoeff() / kDefaultCellsAcross);
  options.min_size = spec.sizing.min_size.value_or(0);
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
  return options;
}

OctreeOptions octree_options(const MeshSpec& spec) {
  OctreeOptions options;
  options.max_cells = spec.sizing.max_cells.value_or(0);
  return options;
}

FeatureOptions feature_options(const MeshSpec& spec) { return {.ridge_angle = spec.features.ridge_angle}; }

}  // namespace strata
