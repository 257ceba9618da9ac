// The table of contents of the mesher: every stage, in the order that data flows.
#include "core/mesher.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/buffer/wrap.h"
#include "core/carve/carve.h"
#include "core/dual/dual.h"
#include "core/features/features.h"
#include "core/fit/fit.h"
#include "core/layers/grow_layers.h"
#include "core/octree/octree.h"
#include "core/optimise/ground.h"
#include "core/optimise/optimise.h"
#include "core/quality/quality.h"
#include "core/sizing/size_field.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"

namespace strata {
namespace {

// The rung is fit_relaxed when more than this share of the boundary vertices stay off the surface by over a quarter of the local edge;
// fewer are an adjustment only.
constexpr double kRelaxedShare = 1e-3;
constexpr double kDefaultCellsAcross = 16;  // default bound for cells: longest side of the bounding box over this

// Figures of the estimate, measured on the benchmark cases (docs/performance.md).
constexpr double kMeshedShareOfDual = 0.42;      // dual hexes that end inside the volume
constexpr double kBytesPerHex = 1200;            // peak of the whole process
constexpr double kCpuSecondsPerHex = 40e-6;

[[noreturn]] void refuse(Diagnostic diagnostic) { throw MeshError(Failure::InvalidInput, std::move(diagnostic)); }

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

void refuse_what_check_finds(const MeshSpec& spec, const Surface& surface) {
  for (Diagnostic& finding : check(spec, surface.patch_names.values()))
    if (finding.severity == Severity::Error) refuse(std::move(finding));
}

void fall_to(Rung& rung, Rung at_least) { rung = std::max(rung, at_least); }

// Reports vertices that stay off their geometry; far ones cost a rung.
void report_relaxed(const FitResult& fit, Rung& rung, Context& context) {
  if (fit.relaxed == 0) return;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SurfaceFitRelaxed;
  diagnostic.severity = Severity::Warning;
  diagnostic.count = fit.relaxed;
  diagnostic.values = {{"vertices", static_cast<double>(fit.relaxed)}, {"farthest_over_edge", fit.worst_off}};
  diagnostic.message = std::to_string(fit.relaxed) + " boundary vertices stay off the surface or its features (by " +
                       std::to_string(fit.worst_off) + " of the local edge at most), because hexes would invert; refine there";
  context.adjusted(std::move(diagnostic));
  if (static_cast<double>(fit.far) > kRelaxedShare * static_cast<double>(fit.held)) fall_to(rung, Rung::FitRelaxed);
}

[[noreturn]] void give_up(const HexMesh& mesh, std::int64_t bad) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.message = std::to_string(bad) + " of " + std::to_string(mesh.hexes.size()) + " hexes could not be made valid";
  throw MeshError(Failure::Internal, std::move(diagnostic));
}

// The degradation ladder of the fit. Features first with ridge layers; where hexes stay bad, features are let go near them, then the surface;
// when even that fails, once more without ridge layers and features.
HexMesh fit_features(HexMesh smooth, const Ground& ground, Rung& rung, Context& context) {
  FitResult matched = match_features(smooth, ground, context);
  if (matched.softened > 0) fall_to(rung, Rung::FeaturesSoftened);
  context.begin(Stage::WrapRidges);
  HexMesh mesh = wrap_ridges(std::move(matched.mesh), ground.features(), context);
  context.begin(Stage::FitToFeatures);
  FitResult fitted = make_valid(fit_to_features(std::move(mesh), ground, context).mesh, ground, context);
  if (fitted.bad > 0) {
    fall_to(rung, Rung::FeaturesSoftened);
    // Labels come from the match; ridge vertices slide on the surface.
    mesh = match_features(std::move(smooth), ground, context).mesh;
    for (Attachment& attachment : mesh.attachment)
      if (attachment.hold == Hold::Curve || attachment.hold == Hold::Corner) attachment = {Hold::Chart, kWholeSurface};
    fitted = make_valid(fit_to_features(std::move(mesh), ground, context).mesh, ground, context);
  }
  if (fitted.softened > 0) fall_to(rung, Rung::FeaturesSoftened);
  if (fitted.bad > 0) give_up(fitted.mesh, fitted.bad);
  report_relaxed(fitted, rung, context);
  return std::move(fitted.mesh);
}

Estimate estimate_of(std::int64_t triangles, const Octree& octree, const MeshSpec& spec) {
  Estimate estimate;
  estimate.triangles = triangles;
  estimate.octree_cells = static_cast<std::int64_t>(octree.block_count()) * 8;
  const auto dual_hexes = static_cast<double>(count_dual_hexes(octree));
  double layer_count = 0;
  for (const LayerSpec& l : spec.layers) layer_count = std::max(layer_count, static_cast<double>(l.count.value_or(5)));
  const double cut_cells = 4.0 * static_cast<double>(std::count(octree.cut.begin(), octree.cut.end(), 1));
  const double hexes = kMeshedShareOfDual * dual_hexes + layer_count * cut_cells;
  estimate.hexes = static_cast<std::int64_t>(hexes);
  estimate.memory_bytes = static_cast<std::int64_t>(kBytesPerHex * std::max(hexes, dual_hexes));
  estimate.cpu_seconds = kCpuSecondsPerHex * hexes;
  return estimate;
}

void to_input_frame(HexMesh& mesh, const Frame& frame) {
  for (Vec3& p : mesh.position) p = frame.to_input(p);
}

// Tells the quality of a mesh that is still in the working frame.
void tell_quality(Stage stage, const HexMesh& mesh, const Surface& surface, const Observer& observer, Context& context) {
  if (!observer.on_quality) return;
  Quality quality = measure_quality(mesh, surface.patch_names, context);
  const double length = 1 / surface.frame.scale;
  for (RegionStatistics& region : quality.regions) region.volume *= length * length * length;
  for (PatchStatistics& patch : quality.patches) patch.area *= length * length;
  observer.on_quality(stage, quality);
}

void add_layer_statistics(Quality& quality, const std::vector<PatchLayers>& layers, const Surface& surface) {
  for (const PatchLayers& l : layers)
    for (PatchStatistics& p : quality.patches) {
      if (p.name != surface.patch_names[l.patch]) continue;
      p.layers_wished = l.wished.count;
      p.first_height_wished = l.wished.first_height / surface.frame.scale;
      p.first_height_mean = l.first_height_mean / surface.frame.scale;
      p.thickness_fraction_mean = l.thickness_fraction_mean;
      p.thickness_fraction_min = l.thickness_fraction_min;
      p.coverage = l.coverage;
    }
}

Rung rung_of(LayersRung rung) {
  switch (rung) {
    case LayersRung::Full: return Rung::Full;
    case LayersRung::Thinned: return Rung::LayersThinned;
    case LayersRung::Regrouped: return Rung::LayersRegrouped;
    case LayersRung::Dropped: return Rung::LayersDropped;
  }
  return Rung::Full;
}

}  // namespace

std::string_view rung_name(Rung rung) {
  switch (rung) {
    case Rung::Full: return "full";
    case Rung::LayersThinned: return "layers_thinned";
    case Rung::LayersRegrouped: return "layers_regrouped";
    case Rung::LayersDropped: return "layers_dropped";
    case Rung::FeaturesSoftened: return "features_softened";
    case Rung::FitRelaxed: return "fit_relaxed";
    case Rung::Staircase: return "staircase";
    case Rung::CarvedDual: return "carved_dual";
  }
  return "unknown";
}

Outcome generate(TriangleSoup soup, const MeshSpec& wish, Context& context, const Observer& observer) {
  Outcome outcome;
  const auto triangles = static_cast<std::int64_t>(soup.triangles.size());

  context.begin(Stage::Condition);
  const Surface surface = condition(std::move(soup), context);
  refuse_what_check_finds(wish, surface);
  const MeshSpec spec = in_working_frame(wish, surface.frame);

  context.begin(Stage::DetectFeatures);
  const Features features = detect_features(surface, {.ridge_angle = spec.features.ridge_angle}, context);

  context.begin(Stage::MakeSizeField);
  const SizeField sizes = make_size_field(surface, features, size_options(spec, surface), context);

  context.begin(Stage::RefineOctree);
  Octree octree = refine_octree(surface, sizes, octree_options(spec), context);
  if (observer.on_estimate) observer.on_estimate(estimate_of(triangles, octree, spec));

  context.begin(Stage::Dualize);
  Dual dual = dualize(std::move(octree), context);

  context.begin(Stage::Carve);
  const Ground ground(surface, features);
  HexMesh mesh;
  {
    const Locator locator(surface);
    mesh = carve(std::move(dual), surface, locator, {.volume = spec.volume}, context);
  }

  context.begin(Stage::WrapSurface);
  mesh = wrap_surface(std::move(mesh), context);

  context.begin(Stage::FitToSmooth);
  mesh = fit_to_smooth(std::move(mesh), ground, context).mesh;
  tell_quality(Stage::FitToSmooth, mesh, surface, observer, context);
  mesh = fit_features(std::move(mesh), ground, outcome.rung, context);
  tell_quality(Stage::FitToFeatures, mesh, surface, observer, context);

  if (!spec.layers.empty()) {
    context.begin(Stage::GrowLayers);
    GrowResult grown = grow_layers(std::move(mesh), spec.layers, ground, context);
    mesh = std::move(grown.mesh);
    tell_quality(Stage::GrowLayers, mesh, surface, observer, context);
    fall_to(outcome.rung, rung_of(grown.rung));
    to_input_frame(mesh, surface.frame);
    context.begin(Stage::MeasureQuality);
    outcome.quality = measure_quality(mesh, surface.patch_names, context);
    add_layer_statistics(outcome.quality, grown.patches, surface);
  } else {
    to_input_frame(mesh, surface.frame);
    context.begin(Stage::MeasureQuality);
    outcome.quality = measure_quality(mesh, surface.patch_names, context);
  }
  context.end();
  outcome.patch_names = surface.patch_names;
  outcome.mesh = std::move(mesh);
  outcome.adjustments = context.adjustments();
  outcome.stages = context.stages();
  return outcome;
}

CheckReport check_request(TriangleSoup soup, const MeshSpec& wish, Context& context) {
  CheckReport report;
  try {
    report.estimate.triangles = static_cast<std::int64_t>(soup.triangles.size());
    const Surface surface = condition(std::move(soup), context);
    report.patch_names = surface.patch_names.values();
    report.findings = check(wish, report.patch_names);
    const bool usable =
        std::none_of(report.findings.begin(), report.findings.end(), [](const Diagnostic& d) { return d.severity == Severity::Error; });
    if (usable) {
      const MeshSpec spec = in_working_frame(wish, surface.frame);
      const Features features = detect_features(surface, {.ridge_angle = spec.features.ridge_angle}, context);
      const SizeField sizes = make_size_field(surface, features, size_options(spec, surface), context);
      const Octree octree = refine_octree(surface, sizes, octree_options(spec), context);
      report.estimate = estimate_of(report.estimate.triangles, octree, spec);
    }
  } catch (const MeshError& error) {
    if (error.failure() != Failure::InvalidInput) throw;
    report.findings.push_back(error.diagnostic());
  }
  for (const Diagnostic& adjustment : context.adjustments()) report.findings.push_back(adjustment);
  return report;
}

}  // namespace strata
