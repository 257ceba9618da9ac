// From sizes to a mesh that follows the surface: octree, dual, carving and fit, with the ladder's rungs for what does not work out, and again
// with finer cells where a mesh falls short.
#pragma once

#include <memory>
#include <vector>

#include "core/carve/carve.h"
#include "core/finer_places.h"
#include "core/fit_features.h"
#include "core/mesher.h"
#include "core/optimise/ground.h"
#include "core/sizing/size_field.h"

namespace strata {

// What every attempt starts from. Working frame.
struct Asked {
  const Surface& surface;
  const Features& features;
  const MeshSpec& spec;
  const Observer& observer;
  std::int64_t triangles;  // of the input, for estimates
  Context& context;
};

// A mesh that follows the surface, and what it stands on.
struct FittedMesh {
  HexMesh mesh;
  std::unique_ptr<const Surface> part;  // without what bounds no meshed volume; null: the whole surface
  std::unique_ptr<const Features> part_features;
  std::unique_ptr<const Ground> ground;
  std::unique_ptr<const MergedGround> merged;  // null: none of its charts became one
  Rung rung = Rung::Full;
  Shortfall shortfall;
  bool touched_itself = false;  // the skin did, and was drawn in there: layers have no room between
  Merit merit;
  std::vector<Diagnostic> adjustments;
  [[nodiscard]] const Surface& skin(const Surface& whole) const { return part ? *part : whole; }
  [[nodiscard]] const Ground& stands_on() const { return merged ? merged->ground : *ground; }
};

// From sizes to the hexes to keep, a sheet of them where solid is thinner than a cell if asked for. Where none fits into the volume, smaller
// cells are tried.
Carved carve_cells(const Asked& asked, SizeField sizes, bool thin_places);

// The mesh at the sizes asked for. Where it misses thin solid, another with sheets of hexes there is tried; where it falls short otherwise,
// others with finer cells there. The best is kept, finer cells are told.
FittedMesh fit_mesh(const Asked& asked, const SizeField& sizes);

// Tells the quality of a mesh that is still in the working frame of the surface.
void tell_quality(Stage stage, const HexMesh& mesh, const Surface& surface, const Observer& observer, Context& context);

inline void fall_to(Rung& rung, Rung at_least) { rung = rung < at_least ? at_least : rung; }

}  // namespace strata
