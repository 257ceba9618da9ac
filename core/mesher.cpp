// The table of contents of the mesher: every stage, in the order that data flows.
#include "core/mesher.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <utility>

#include "core/estimate.h"
#include "core/features/features.h"
#include "core/fit_mesh.h"
#include "core/ladder.h"
#include "core/layers/grow_layers.h"
#include "core/quality/quality.h"
#include "core/sizing/size_field.h"
#include "core/surface/axes.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"
#include "core/wishes.h"

namespace strata {
namespace {

[[noreturn]] void refuse(Diagnostic diagnostic) { throw MeshError(Failure::InvalidInput, std::move(diagnostic)); }

void refuse_what_check_finds(const MeshSpec& spec, const Surface& surface) {
  for (Diagnostic& finding : check(spec, surface.patch_names.values()))
    if (finding.severity == Severity::Error) refuse(std::move(finding));
}

[[noreturn]] void refuse_staircase() {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::LayersDropped;
  diagnostic.message = "they grow on a mesh that follows the surface only";
  throw MeshError(Failure::Internal, std::move(diagnostic));
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

// Layers where they can be had, else the mesh as it was.
HexMesh grow_or_drop(HexMesh mesh, const Ground& ground, const std::vector<LayerSpec>& layers, std::vector<PatchLayers>& grown, Rung& rung,
                     Context& context) {
  context.begin(Stage::GrowLayers);
  HexMesh layered;
  const auto failure = failure_of([&] {
    if (rung >= Rung::Staircase) refuse_staircase();
    GrowResult result = grow_layers(mesh, layers, ground, context);
    require(result.mesh);
    layered = take_off_itself(std::move(result.mesh), context).mesh;
    require_in_input(layered, ground.surface().frame);
    grown = std::move(result.patches);
    fall_to(rung, rung_of(result.rung));
  });
  if (failure) {
    fall_to(rung, Rung::LayersDropped);
    report_fall(*failure, Reason::LayersDropped, "the mesh has no layers", context);
    layered = std::move(mesh);
  }
  return layered;
}

void tell_rounded(const RoundedRidges& rounded, const Frame& frame, Context& context) {
  if (rounded.length == 0) return;
  Diagnostic d;
  d.reason = Reason::RidgeFilleted;
  d.severity = Severity::Warning;
  d.box = frame.to_input(rounded.box);
  const double length = rounded.length / frame.scale, degrees = rounded.sharpest * 180 / std::numbers::pi;
  // A fillet of half the local size between two faces leaves this of their edge (dossier 5.4).
  const double short_of = 0.5 * (1 / std::sin(0.5 * rounded.sharpest) - 1);
  d.values = {{"length", length}, {"sharpest_degrees", degrees}, {"sizes", short_of}};
  char text[160];
  std::snprintf(text, sizeof text,
                "ridges under 60 degrees are rounded as asked, %.4g long in all; at the sharpest, %.3g degrees, the mesh ends some %.2g "
                "cells short of the edge",
                length, degrees, short_of);
  d.message = text;
  context.adjusted(std::move(d));
}

// In a frame whose axes the cells follow best. Boxes and maps of sizes stand along the input's.
Surface conditioned(TriangleSoup soup, const MeshSpec& wish, Context& context) {
  Surface surface = condition(std::move(soup), context);
  const bool is_bound = !wish.sizing.boxes.empty() || wish.sizing.background.has_value();
  const Mat3 axes = is_bound ? Mat3(Mat3::Identity()) : best_axes(surface);
  return turned(std::move(surface), axes);
}

void to_input_frame(HexMesh& mesh, const Frame& frame) {
  for (Vec3& p : mesh.position) p = frame.to_input(p);
}

void add_layer_statistics(Quality& quality, const std::vector<PatchLayers>& layers, const Surface& surface) {
  for (const PatchLayers& l : layers)
    for (PatchStatistics& p : quality.patches) {
      if (p.name != surface.patch_names[l.patch]) continue;
      p.layers_wished = l.wished.count;
      p.layers = l.count;
      p.first_height_wished = l.wished.first_height / surface.frame.scale;
      p.first_height_mean = l.first_height_mean / surface.frame.scale;
      p.thickness_fraction_mean = l.thickness_fraction_mean;
      p.thickness_fraction_min = l.thickness_fraction_min;
      p.coverage = l.coverage;
    }
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
  const Surface surface = conditioned(std::move(soup), wish, context);
  refuse_what_check_finds(wish, surface);
  const MeshSpec spec = in_working_frame(wish, surface.frame);

  context.begin(Stage::DetectFeatures);
  const Features features = detect_features(surface, feature_options(spec), context);
  tell_rounded(features.rounded, surface.frame, context);

  context.begin(Stage::MakeSizeField);
  const SizeField sizes = make_size_field(surface, features, size_options(spec, surface, features), context);

  FittedMesh fitted = fit_mesh({surface, features, spec, observer, triangles, context}, sizes);
  for (Diagnostic& adjustment : fitted.adjustments) context.adjusted(std::move(adjustment));
  outcome.rung = fitted.rung;
  HexMesh mesh = std::move(fitted.mesh);

  std::vector<PatchLayers> grown;
  if (!spec.layers.empty()) {
    mesh = grow_or_drop(std::move(mesh), fitted.stands_on(), spec.layers, grown, outcome.rung, context);
    tell_quality(Stage::GrowLayers, mesh, fitted.skin(surface), observer, context);
  }

  to_input_frame(mesh, surface.frame);
  context.begin(Stage::MeasureQuality);
  report_folded(mesh, context);
  outcome.quality = measure_quality(mesh, surface.patch_names, context);
  add_layer_statistics(outcome.quality, grown, surface);
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
    const Surface surface = conditioned(std::move(soup), wish, context);
    report.patch_names = surface.patch_names.values();
    report.findings = check(wish, report.patch_names);
    const bool usable =
        std::none_of(report.findings.begin(), report.findings.end(), [](const Diagnostic& d) { return d.severity == Severity::Error; });
    if (usable) {
      const MeshSpec spec = in_working_frame(wish, surface.frame);
      const Features features = detect_features(surface, feature_options(spec), context);
      tell_rounded(features.rounded, surface.frame, context);
      const SizeField sizes = make_size_field(surface, features, size_options(spec, surface, features), context);
      const std::int64_t triangles = report.estimate.triangles;
      const Observer observer{[&](const Estimate& estimate) { report.estimate = estimate; }, {}};
      const Carved carved = carve_cells({surface, features, spec, observer, triangles, context}, sizes, false);
      report.estimate = count_hexes(report.estimate, carved.mesh, surface, Locator(surface), spec);
    }
  } catch (const MeshError& error) {
    if (error.failure() != Failure::InvalidInput) throw;
    report.findings.push_back(error.diagnostic());
  }
  for (const Diagnostic& adjustment : context.adjustments()) report.findings.push_back(adjustment);
  return report;
}

}  // namespace strata
