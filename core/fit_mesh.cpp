#include "core/fit_mesh.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <optional>
#include <string>
#include <utility>

#include "core/base/context.h"
#include "core/buffer/wrap.h"
#include "core/dual/dual.h"
#include "core/estimate.h"
#include "core/features/features.h"
#include "core/fit/fit.h"
#include "core/fit/retreat.h"
#include "core/ladder.h"
#include "core/octree/octree.h"
#include "core/quality/quality.h"
#include "core/surface/locator.h"
#include "core/wishes.h"

namespace strata {
namespace {

constexpr int kFacesOfHex = 6;
constexpr int kFinerAttempts = 2;  // with finer cells where the mesh fell short
constexpr double kMostHexes = 2;   // times those of the first mesh: carved cells of one with finer places
constexpr int kMostRounds = 4;     // of the fits so far, to try again: more means that creases are noise, or cells too large everywhere
constexpr int kFinerTries = 3;  // cells are halved so often, where the volume is thinner than they are

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
  if (fit.is_relaxed()) fall_to(rung, Rung::FitRelaxed);
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

// What a fit hands on.
struct Fitted {
  HexMesh mesh;
  std::unique_ptr<const MergedGround> merged;
  Shortfall shortfall;
  bool touched_itself = false;
};

// What the stages from the fit on share.
struct Run {
  const Surface& whole;    // as conditioned
  const Surface& surface;  // what of it bounds the meshed volumes
  const Ground& ground;
  const Observer& observer;
  Context& context;
  Rung& rung;
  bool thin_places;
};

constexpr Promises kUnfitted{.labelled = false, .positive = false};

[[noreturn]] void give_up(const HexMesh& mesh, std::int64_t bad) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::InvariantViolated;
  diagnostic.message = std::to_string(bad) + " of " + std::to_string(mesh.hexes.size()) + " hexes could not be made valid";
  throw MeshError(Failure::Internal, std::move(diagnostic));
}

// Features are fitted; what had to be given up costs a rung.
Fitted fit_features_or_throw(const HexMesh& smooth, const Ground& ground, Rung& rung, Shortfall& shortfall, Context& context) {
  FeatureFit fit = fit_features(smooth, ground, context);
  shortfall = {std::move(fit.result.places), fit.rounds};
  report_softened(fit.softened, ground, context);
  if (!fit.softened.empty() || fit.result.let_go) fall_to(rung, Rung::FeaturesSoftened);
  if (fit.result.let_go) context.adjusted(std::move(*fit.result.let_go));
  if (fit.result.bad > 0) give_up(fit.result.mesh, fit.result.bad);
  report_relaxed(fit.result, rung, context);
  return {std::move(fit.result.mesh), std::move(fit.merged), {}};
}

// The smooth fit, gone back towards the staircase where hexes would invert.
HexMesh smooth_without_features(const HexMesh& wrapped, HexMesh smooth, const Diagnostic& failure, const Run& run) {
  Retreat gone_back = retreat(make_staircase(wrapped, run.ground, run.context), std::move(smooth));
  HexMesh mesh = label_by_nearest(std::move(gone_back.mesh), run.ground);
  require(mesh);
  mesh = take_off_itself(std::move(mesh), run.context).mesh;
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
      smooth = fit_to_smooth(wrapped, run.ground, run.whole, run.thin_places, run.context).mesh;
      require(smooth, kUnfitted);
      tell_quality(Stage::FitToSmooth, smooth, run.surface, run.observer, run.context);
      fitted = fit_features_or_throw(smooth, run.ground, run.rung, shortfall, run.context);
      require(fitted.mesh);
      OffItself off_itself = take_off_itself(std::move(fitted.mesh), run.context);
      fitted.mesh = std::move(off_itself.mesh);
      fitted.touched_itself = off_itself.touched;
      require_in_input(fitted.mesh, run.surface.frame);
      tell_quality(Stage::FitToFeatures, fitted.mesh, run.surface, run.observer, run.context);
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

// From carved cells to a mesh that follows the surface. What differs from the wish is kept back.
FittedMesh attempt(const Asked& asked, Carved carved, bool thin_places) {
  Context& context = asked.context;
  FittedMesh result;
  context.hold_adjustments();
  if (std::optional<Surface> part = without_strangers(asked.surface, carved.bounds, context)) {
    result.part = std::make_unique<const Surface>(std::move(*part));
    result.part_features = std::make_unique<const Features>(detect_features(*result.part, feature_options(asked.spec), context));
  }
  const Surface& skin = result.skin(asked.surface);
  result.ground = std::make_unique<const Ground>(skin, result.part ? *result.part_features : asked.features);
  Fitted fitted =
      fit_or_fall(std::move(carved.mesh), {asked.surface, skin, *result.ground, asked.observer, context, result.rung, thin_places});
  result.mesh = std::move(fitted.mesh);
  result.merged = std::move(fitted.merged);
  result.shortfall = std::move(fitted.shortfall);
  result.touched_itself = fitted.touched_itself;
  result.adjustments = context.take_held_adjustments();
  return result;
}

// Nothing where the mesh would be too large, for the limits of the run or beside the first, or where anything goes wrong: the first mesh is
// still there. What carving tells was told the first time.
std::optional<FittedMesh> attempt_again(const Asked& asked, const SizeField& sizes, bool thin_places, double most_hexes) {
  Context& context = asked.context;
  std::optional<FittedMesh> result;
  try {
    context.hold_adjustments();
    Carved carved = carve_cells(asked, sizes, thin_places);
    const std::vector<Diagnostic> told = context.take_held_adjustments();
    const auto is_coarsened = [](const Diagnostic& d) { return d.reason == Reason::SizeCoarsened; };
    const bool is_too_large = static_cast<double>(carved.mesh.hexes.size()) > most_hexes;
    if (!is_too_large && std::none_of(told.begin(), told.end(), is_coarsened)) result = attempt(asked, std::move(carved), thin_places);
  } catch (const MeshError& error) {
    if (error.failure() == Failure::Cancelled) throw;
  } catch (const std::exception&) {
    result.reset();
  }
  if (!result) context.take_held_adjustments();
  return result;
}

bool is_better(const FittedMesh& a, const FittedMesh& b) {
  if ((a.rung > Rung::FeaturesSoftened) != (b.rung > Rung::FeaturesSoftened)) return a.rung < b.rung;
  if (a.touched_itself && !b.touched_itself) return false;
  return is_better(a.merit, b.merit);
}

// Asks for finer cells where the attempt fell short. False: it did not, or they would be too many.
bool refine(SizeField& sizes, const FittedMesh& attempt, const IdMap<CurveId, std::uint8_t>& counts) {
  if (attempt.rung > Rung::FitRelaxed || (attempt.rung < Rung::FitRelaxed && attempt.merit.will_do())) return false;
  FinerPlaces finer = finer_places(attempt.mesh, attempt.shortfall, *attempt.ground, counts);
  if (finer.empty()) return false;
  sizes.segments.insert(sizes.segments.end(), finer.segments.begin(), finer.segments.end());
  sizes.sources.insert(sizes.sources.end(), finer.balls.begin(), finer.balls.end());
  return true;
}

void report_refined(const SizeField& sizes, const SizeField& finer, const Surface& surface, FittedMesh& attempt) {
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

}  // namespace

void tell_quality(Stage stage, const HexMesh& mesh, const Surface& surface, const Observer& observer, Context& context) {
  if (!observer.on_quality) return;
  Quality quality = measure_quality(mesh, surface.patch_names, context);
  const double length = 1 / surface.frame.scale;
  for (RegionStatistics& region : quality.regions) region.volume *= length * length * length;
  for (PatchStatistics& patch : quality.patches) patch.area *= length * length;
  observer.on_quality(stage, quality);
}

Carved carve_cells(const Asked& asked, SizeField sizes, bool thin_places) {
  const auto& [surface, features, spec, observer, triangles, context] = asked;
  const Locator locator(surface);
  for (int halved = 0;; ++halved) {
    context.begin(Stage::RefineOctree);
    Octree octree = refine_octree(surface, sizes, octree_options(spec), context);
    if (observer.on_estimate) observer.on_estimate(estimate_of(triangles, octree, spec));

    context.begin(Stage::Dualize);
    Dual dual = dualize(std::move(octree), context);

    context.begin(Stage::Carve);
    try {
      Carved carved = carve(std::move(dual), surface, locator, {.volume = spec.volume, .thin_places = thin_places}, context);
      require(carved.mesh, {.quads_per_hex = kFacesOfHex, .labelled = false});
      report_halved(halved, context);
      return carved;
    } catch (const MeshError& error) {
      if (error.diagnostic().reason != Reason::RegionTooThin || halved == kFinerTries) throw;
    }
    halve(sizes);
  }
}

FittedMesh fit_mesh(const Asked& asked, const SizeField& sizes) {
  FittedMesh best = attempt(asked, carve_cells(asked, sizes, false), false);
  const IdMap<CurveId, std::uint8_t> counts = curves_that_count(best.mesh, *best.ground);
  best.merit = merit_of(best.mesh, *best.ground, counts);
  const double most_hexes = kMostHexes * static_cast<double>(best.mesh.hexes.size());
  int rounds = best.shortfall.rounds;
  const auto improve = [&](const SizeField& at, bool with_thin_places) {
    if (rounds > kMostRounds) return false;
    std::optional<FittedMesh> next = attempt_again(asked, at, with_thin_places, most_hexes);
    if (!next || next->ground->features().curves.size() != counts.size()) return false;  // the latter: not of the same volume
    rounds += next->shortfall.rounds;
    next->merit = merit_of(next->mesh, *next->ground, counts);
    if (!is_better(*next, best)) return false;
    if (&at != &sizes) report_refined(sizes, at, asked.surface, *next);
    best = std::move(*next);
    return true;
  };
  SizeField finer = sizes;
  bool asks = refine(finer, best, counts);
  // What could not follow the surface may have been cells of a body too thin for them.
  bool thin_places = (best.merit.misses_thin_places() || best.rung == Rung::FitRelaxed) && improve(sizes, true);
  if (thin_places) {  // finer cells alone may do better
    if (asks && improve(finer, false)) thin_places = false;
    else finer = sizes;
    asks = refine(finer, best, counts);
  }
  for (int again = 0; asks && again < kFinerAttempts && improve(finer, thin_places); ++again) asks = refine(finer, best, counts);
  return best;
}

}  // namespace strata
