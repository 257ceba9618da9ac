// The only door into the mesher.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/context.h"
#include "core/mesh/hex_mesh.h"
#include "core/quality/quality.h"
#include "core/spec/mesh_spec.h"
#include "core/surface/triangle_soup.h"

namespace strata {

// How far the mesh fell short of the full request (docs/flow.md, "degradation ladder"); larger is worse.
enum class Rung {
  Full,
  LayersThinned,
  LayersRegrouped,   // fewer groups: regular instead of cross-imprint
  LayersDropped,     // on some patches
  FeaturesSoftened,
  FitRelaxed,
  Staircase,
  CarvedDual,
};
// "full", "layers_thinned", ...
std::string_view rung_name(Rung rung);

struct Outcome {
  HexMesh mesh;                           // input units
  IdMap<PatchId, std::string> patch_names; // reference of a patch in files = id + 1
  Quality quality;
  Rung rung = Rung::Full;
  std::vector<Diagnostic> adjustments;
  std::vector<StageRecord> stages;
};

// What a run would cost. Exact: triangles and octree_cells; in check_request also hexes, but for what ridges add and layers give up.
struct Estimate {
  std::int64_t triangles = 0;
  std::int64_t octree_cells = 0;
  std::int64_t hexes = 0;         // with layers
  std::int64_t memory_bytes = 0;
  double cpu_seconds = 0;
};

// What a run tells on its way besides Context's progress; empty functions are not called. Called from the thread that runs the pipeline.
struct Observer {
  std::function<void(const Estimate&)>
      on_estimate;            // when an octree exists, again for each finer one; what it throws ends the run, later the attempt
  std::function<void(Stage, const Quality&)> on_quality;       // of the mesh as it is after the stage; layers' wishes are not in it yet
};

// Meshes the surface as asked. Runs on the calling thread and its TBB arena; same input, same bytes out for any thread count.
// Throws MeshError: InvalidInput (with the first thing wrong), LimitExceeded, Cancelled, Internal.
Outcome generate(TriangleSoup soup, const MeshSpec& spec, Context& context, const Observer& observer = {});

struct CheckReport {
  std::vector<Diagnostic> findings;   // of surface and specification; any Severity::Error means generate would refuse
  std::vector<std::string> patch_names;
  Estimate estimate;                  // zero when there are errors
};
CheckReport check_request(TriangleSoup soup, const MeshSpec& spec, Context& context);

}  // namespace strata
