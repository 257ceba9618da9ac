// The table of contents of the mesher: every stage, in the order that data flows.
#include "core/mesher.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/buffer/wrap.h"
#include "core/carve/carve.h"
#include "core/dual/dual.h"
#include "core/estimate.h"
#include "core/features/features.h"
#include "core/finer_places.h"
#include "core/fit/fit.h"
#include "core/fit/part_contacts.h"
#include "core/fit/retreat.h"
#include "core/fit_features.h"
#include "core/ladder.h"
#include "core/layers/grow_layers.h"
#include "core/octree/octree.h"
#include "core/optimise/ground.h"
#include "core/optimise/optimise.h"
#include "core/quality/quality.h"
#include "core/sizing/size_field.h"
#include "core/surface/locator.h"
#include "core/surface/surface.h"
#include "core/wishes.h"

namespace strata {
namespace {

// The rung is fit_relaxed when more than this share of the boundary vertices stay off the surface by over a quarter of the local edge;
// fewer are an adjustment only.
constexpr double kRelaxedShare = 1e-3;
constexpr int kFacesOfHex = 6;
constexpr int kFinerAttempts = 2;  // with finer cells where the mesh fell short
constexpr int kMostRounds = 3;     // of the fit, to try again: more means that creases are noise, or cells too large everywhere
constexpr int kFinerTries = 3;  // cells are halved so often, where the volume is thinner than they are

[[noreturn]] void refuse(Diagnostic diagnostic) { throw MeshError(Failure::InvalidInput, std::move(diagnostic)); }

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

// Cells of the surface half as large.
void halve(SizeField& sizes) {
  for (double& size : sizes.at_triangle) size = 0.5 * std::max(std::min(size, sizes.max_size), sizes.min_size);
  for (SizedSegment& segment : sizes.segments) segment.size *= 0.5;
  sizes.min_size = std::min(sizes.min_size, 0.5 * sizes.max_size);
  for (const double size : sizes.at_triangle) sizes.min_size = std::min(sizes.min_size, size);
}

void report_halved(int times, Context& context) {
  if (times == 0) return;
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SizeRefined;
  diagnostic.severity = Severity::Warning;
  diagnostic.values = {{"factor", std::ldexp(1.0, -times)}};
  diagnostic.message =
      "the enclosed volume is thinner than the cells asked for: cells at the surface are " + std::to_string(1 << times) + " times smaller";
  context.adjusted(std::move(diagnostic));
}

// From sizes to the hexes to keep. Where none fits into the volume, smaller cells are tried.
Carved carve_cells(const Surface& surface, SizeField sizes, const MeshSpec& spec, const Observer& observer, std::int64_t triangles,
                   Context& context) {
  const Locator locator(surface);
  for (int halved = 0;; ++halved) {
    context.begin(Stage::RefineOctree);
    Octree octree = refine_octree(surface, sizes, octree_options(spec), context);
    if (observer.on_estimate) observer.on_estimate(estimate_of(triangles, octree, spec));

    context.begin(Stage::Dualize);
    Dual dual = dualize(std::move(octree), context);

    context.begin(Stage::Carve);
    try {
      Carved carved = carve(std::move(dual), surface, locator, {.volume = spec.volume}, context);
      require(carved.mesh, {.quads_per_hex = kFacesOfHex, .labelled = false});
      report_halved(halved, context);
      return carved;
    } catch (const MeshError& error) {
      if (error.diagnostic().reason != Reason::RegionTooThin || halved == kFinerTries) throw;
    }
    halve(sizes);
  }
}

// The surface without what bounds no meshed volume: other solids, shells in a volume meshed as one. Empty: all of it bounds some.
std::optional<Surface> without_strangers(const Surface& surface, const IdMap<TriangleId, Bounds>& bounds, Context& context) {
  IdMap<TriangleId, std::uint8_t> keep(surface.triangles.size(), std::uint8_t{1});
  Diagnostic diagnostic;
  for (TriangleId t : bounds.ids()) {
    if (bounds[t] != Bounds::Nothing) continue;
    keep[t] = 0;
    ++diagnostic.count;
    for (const Vec3& p : surface.corners(t)) diagnostic.box.add(surface.frame.to_input(p));
    if (diagnostic.triangles.size() < Diagnostic::kMaxListed) diagnostic.triangles.push_back(surface.source[t]);
  }
  if (diagnostic.count == 0 || diagnostic.count == static_cast<std::int64_t>(keep.size())) return {};
  diagnostic.reason = Reason::SurfaceSheetDropped;
  diagnostic.severity = Severity::Info;
  diagnostic.values = {{"count", static_cast<double>(diagnostic.count)}};
  diagnostic.message = std::to_string(diagnostic.count) + " triangles bound none of the meshed volumes: the mesh does not follow them";
  context.adjusted(std::move(diagnostic));
  return part_of(surface, keep);
}

// A mesh that follows the surface, and the ground it stands on where that is not the one given.
struct Fitted {
  HexMesh mesh;
  std::unique_ptr<const MergedGround> merged;
  Shortfall shortfall;
};

// What the stages from the fit on share.
struct Run {
  const Surface& surface;
  const Ground& ground;
  const Observer& observer;
  Context& context;
  Rung& rung;
};

// Tells the quality of a mesh that is still in the working frame.
void tell_quality(Stage stage, const HexMesh& mesh, const Run& run) {
  if (!run.observer.on_quality) return;
  Quality quality = measure_quality(mesh, run.surface.patch_names, run.context);
  const double length = 1 / run.surface.frame.scale;
  for (RegionStatistics& region : quality.regions) region.volume *= length * length * length;
  for (PatchStatistics& patch : quality.patches) patch.area *= length * length;
  run.observer.on_quality(stage, quality);
}

constexpr Promises kUnfitted{.labelled = false, .positive = false};

[[noreturn]] void refuse_staircase() {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::LayersDropped;
  diagnostic.message = "they grow on a mesh that follows the surface only";
  throw MeshError(Failure::Internal, std::move(diagnostic));
}

[[noreturn]] void give_up(const HexMesh& mesh, std::int64_t bad) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.message = std::to_string(bad) + " of " + std::to_string(mesh.hexes.size()) + " hexes could not be made valid";
  throw MeshError(Failure::Internal, std::move(diagnostic));
}

// Features are fitted; what had to be given up costs a rung.
Fitted fit_features_or_throw(const HexMesh& smooth, const Ground& ground, Rung& rung, Shortfall& shortfall, Context& context) {
  FeatureFit fit = fit_features(smooth, ground, context);
  shortfall = {fit.softened, std::move(fit.result.places), fit.rounds};
  report_softened(fit.softened, ground, context);
  if (!fit.softened.empty() || fit.result.let_go) fall_to(rung, Rung::FeaturesSoftened);
  if (fit.result.let_go) context.adjusted(std::move(*fit.result.let_go));
  if (fit.result.bad > 0) give_up(fit.result.mesh, fit.result.bad);
  report_relaxed(fit.result, rung, context);
  return {std::move(fit.result.mesh), std::move(fit.merged), {}};
}

// Whoever reads a mesh whose skin touches itself takes the place for a crack.
HexMesh take_off_itself(HexMesh mesh, Context& context) {
  PartedContacts parted = part_contacts(std::move(mesh));
  if (parted.left > 0) require_no_contacts(parted.mesh);
  if (parted.moved > 0) {
    Diagnostic diagnostic;
    diagnostic.reason = Reason::SurfaceFitRelaxed;
    diagnostic.severity = Severity::Warning;
    diagnostic.count = parted.moved;
    diagnostic.values = {{"vertices", static_cast<double>(parted.moved)}};
    diagnostic.message = std::to_string(parted.moved) + " boundary vertices were drawn in, because the skin touched itself there";
    context.adjusted(std::move(diagnostic));
  }
  return std::move(parted.mesh);
}

// The smooth fit, gone back towards the staircase where hexes would invert.
HexMesh smooth_without_features(const HexMesh& wrapped, HexMesh smooth, const Diagnostic& failure, const Run& run) {
  Retreat gone_back = retreat(make_staircase(wrapped, run.ground, run.context), std::move(smooth));
  HexMesh mesh = label_by_nearest(std::move(gone_back.mesh), run.ground);
  require(mesh);
  mesh = take_off_itself(std::move(mesh), run.context);
  require_in_input(mesh, run.surface.frame);
  fall_to(run.rung, Rung::FitRelaxed);
  report_fall(failure, Reason::SurfaceFitRelaxed,
              "features could not be held: the mesh follows the surface without them, but for " + std::to_string(gone_back.moved) +
                  " boundary vertices that stay off it",
              run.context);
  return mesh;
}

// The ladder's last rungs: what cannot be fitted keeps the staircase of its cells, in the buffer layer or bare.
Fitted fit_or_fall(HexMesh carved, const Run& run) {
  HexMesh mesh, wrapped, smooth;
  Fitted fitted;
  Shortfall shortfall;
  run.context.begin(Stage::WrapSurface);
  auto failure = failure_of([&] {
    wrapped = wrap_surface(carved, run.context);
    require(wrapped, kUnfitted);
  });
  if (!failure) {
    run.context.begin(Stage::FitToSmooth);
    failure = failure_of([&] {
      smooth = fit_to_smooth(wrapped, run.ground, run.context).mesh;
      require(smooth, kUnfitted);
      tell_quality(Stage::FitToSmooth, smooth, run);
      fitted = fit_features_or_throw(smooth, run.ground, run.rung, shortfall, run.context);
      require(fitted.mesh);
      fitted.mesh = take_off_itself(std::move(fitted.mesh), run.context);
      require_in_input(fitted.mesh, run.surface.frame);
      tell_quality(Stage::FitToFeatures, fitted.mesh, run);
    });
    if (!failure) {
      fitted.shortfall = std::move(shortfall);
      return fitted;
    }
    if (!smooth.hexes.empty() && !failure_of([&] { mesh = smooth_without_features(wrapped, std::move(smooth), *failure, run); }))
      return {std::move(mesh), nullptr, std::move(shortfall)};
    fall_to(run.rung, Rung::Staircase);
    report_fall(*failure, Reason::SurfaceFitRelaxed, "the mesh could not be fitted to the surface and keeps the staircase of its cells",
                run.context);
    failure = failure_of([&] {
      mesh = make_staircase(std::move(wrapped), run.ground, run.context);
      require(mesh);
    });
    if (!failure) return {std::move(mesh), nullptr, {}};
  }
  fall_to(run.rung, Rung::CarvedDual);
  report_fall(*failure, Reason::SurfaceFitRelaxed, "no buffer layer could be laid round the cells inside the surface: they are left bare",
              run.context);
  return {label_by_nearest(std::move(carved), run.ground), nullptr, {}};
}

// What every attempt at a fitted mesh starts from.
struct Asked {
  const Surface& surface;
  const Features& features;
  const MeshSpec& spec;
  const Observer& observer;
  std::int64_t triangles;
  Context& context;
};
struct Attempt {
  std::unique_ptr<const Surface> part;  // null: the whole surface
  std::unique_ptr<const Features> part_features;
  std::unique_ptr<const Ground> ground;
  Fitted fitted;
  Rung rung = Rung::Full;
  Merit merit;
  std::vector<Diagnostic> adjustments;
  [[nodiscard]] const Surface& skin(const Surface& whole) const { return part ? *part : whole; }
};

// From sizes to a mesh that follows the surface.
Attempt attempt(const Asked& asked, const SizeField& sizes) {
  Context& context = asked.context;
  Attempt result;
  context.hold_adjustments();
  Carved carved = carve_cells(asked.surface, sizes, asked.spec, asked.observer, asked.triangles, context);
  if (std::optional<Surface> part = without_strangers(asked.surface, carved.bounds, context)) {
    result.part = std::make_unique<const Surface>(std::move(*part));
    result.part_features = std::make_unique<const Features>(detect_features(*result.part, feature_options(asked.spec), context));
  }
  const Surface& skin = result.skin(asked.surface);
  result.ground = std::make_unique<const Ground>(skin, result.part ? *result.part_features : asked.features);
  result.fitted = fit_or_fall(std::move(carved.mesh), {skin, *result.ground, asked.observer, context, result.rung});
  result.adjustments = context.take_held_adjustments();
  return result;
}

bool is_better(const Attempt& a, const Attempt& b) {
  if ((a.rung > Rung::FeaturesSoftened) != (b.rung > Rung::FeaturesSoftened)) return a.rung < b.rung;
  return is_better(a.merit, b.merit);
}

// Asks for finer cells where the attempt fell short. False: it did not, or they would be too many.
bool refine(SizeField& sizes, const Attempt& attempt, const IdMap<CurveId, std::uint8_t>& counts) {
  if (attempt.rung > Rung::FitRelaxed || (attempt.rung < Rung::FitRelaxed && attempt.merit.will_do())) return false;
  if (attempt.fitted.shortfall.rounds > kMostRounds) return false;
  FinerPlaces finer = finer_places(attempt.fitted.mesh, attempt.fitted.shortfall, *attempt.ground, counts);
  if (finer.empty()) return false;
  sizes.segments.insert(sizes.segments.end(), finer.segments.begin(), finer.segments.end());
  sizes.sources.insert(sizes.sources.end(), finer.balls.begin(), finer.balls.end());
  return true;
}

void report_refined(const SizeField& sizes, const SizeField& finer, const Surface& surface, Attempt& attempt) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SizeRefined;
  diagnostic.severity = Severity::Warning;
  for (std::size_t i = sizes.sources.size(); i < finer.sources.size(); ++i) diagnostic.box.add(surface.frame.to_input(finer.sources[i].a));
  for (std::size_t i = sizes.segments.size(); i < finer.segments.size(); ++i)
    diagnostic.box.add(surface.frame.to_input(finer.segments[i].from));
  const auto places =
      static_cast<std::int64_t>(finer.sources.size() - sizes.sources.size() + finer.segments.size() - sizes.segments.size());
  diagnostic.count = places;
  diagnostic.values = {{"places", static_cast<double>(places)}};
  diagnostic.message = "cells are smaller than asked for at " + std::to_string(places) +
                       " places, where larger ones could not follow the features or would be poor";
  attempt.adjustments.push_back(std::move(diagnostic));
}

// The mesh at the sizes asked for or, where that falls short, with finer cells there.
Attempt best_attempt(const Asked& asked, const SizeField& sizes) {
  Attempt best = attempt(asked, sizes);
  const IdMap<CurveId, std::uint8_t> counts = curves_that_count(best.fitted.mesh, *best.ground);
  const auto judge = [&](Attempt& a) { a.merit = merit_of(a.fitted.mesh, a.fitted.shortfall, *a.ground, counts); };
  judge(best);
  SizeField finer = sizes;
  for (int again = 0; again < kFinerAttempts && refine(finer, best, counts); ++again) {
    Attempt next = attempt(asked, finer);
    if (next.ground->features().curves.size() != counts.size()) break;  // not of the same volume
    judge(next);
    if (!is_better(next, best)) break;
    report_refined(sizes, finer, asked.surface, next);
    best = std::move(next);
  }
  return best;
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
HexMesh grow_or_drop(HexMesh mesh, const Ground& ground, const std::vector<LayerSpec>& layers, std::vector<PatchLayers>& grown,
                     const Run& run) {
  run.context.begin(Stage::GrowLayers);
  HexMesh layered;
  const auto failure = failure_of([&] {
    if (run.rung >= Rung::Staircase) refuse_staircase();
    GrowResult result = grow_layers(mesh, layers, ground, run.context);
    require(result.mesh);
    layered = take_off_itself(std::move(result.mesh), run.context);
    require_in_input(layered, run.surface.frame);
    grown = std::move(result.patches);
    fall_to(run.rung, rung_of(result.rung));
  });
  if (failure) {
    fall_to(run.rung, Rung::LayersDropped);
    report_fall(*failure, Reason::LayersDropped, "the mesh has no layers", run.context);
    layered = std::move(mesh);
  }
  tell_quality(Stage::GrowLayers, layered, run);
  return layered;
}

void to_input_frame(HexMesh& mesh, const Frame& frame) {
  for (Vec3& p : mesh.position) p = frame.to_input(p);
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
  const Features features = detect_features(surface, feature_options(spec), context);

  context.begin(Stage::MakeSizeField);
  const SizeField sizes = make_size_field(surface, features, size_options(spec, surface, features), context);

  const Asked asked{surface, features, spec, observer, triangles, context};
  Attempt best = best_attempt(asked, sizes);
  for (Diagnostic& adjustment : best.adjustments) context.adjusted(std::move(adjustment));
  outcome.rung = best.rung;
  HexMesh mesh = std::move(best.fitted.mesh);

  const Run run{best.skin(surface), *best.ground, observer, context, outcome.rung};
  std::vector<PatchLayers> grown;
  if (!spec.layers.empty())
    mesh = grow_or_drop(std::move(mesh), best.fitted.merged ? best.fitted.merged->ground : *best.ground, spec.layers, grown, run);

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
    const Surface surface = condition(std::move(soup), context);
    report.patch_names = surface.patch_names.values();
    report.findings = check(wish, report.patch_names);
    const bool usable =
        std::none_of(report.findings.begin(), report.findings.end(), [](const Diagnostic& d) { return d.severity == Severity::Error; });
    if (usable) {
      const MeshSpec spec = in_working_frame(wish, surface.frame);
      const Features features = detect_features(surface, feature_options(spec), context);
      const SizeField sizes = make_size_field(surface, features, size_options(spec, surface, features), context);
      const std::int64_t triangles = report.estimate.triangles;
      const Observer observer{[&](const Estimate& estimate) { report.estimate = estimate; }, {}};
      const Carved carved = carve_cells(surface, sizes, spec, observer, triangles, context);
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
