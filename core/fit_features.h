// The fit to features, with what has to give way for it.
#pragma once

#include <memory>
#include <vector>

#include "core/features/features.h"
#include "core/fit/fit.h"
#include "core/optimise/ground.h"

namespace strata {

class Context;

// The ground where some charts are one (features/merge_charts.h).
struct MergedGround {
  Features features;
  Ground ground;
  MergedGround(const Ground& of, const IdMap<ChartId, ChartId>& into);
};

struct FeatureFit {
  FitResult result;                            // its `bad` is not 0 when all that could give way did not help
  std::vector<CurveId> softened;               // ascending
  int rounds = 0;                              // it took
  std::unique_ptr<const MergedGround> merged;  // what the mesh stands on; null: the ground given
};

// Features are matched, given rows of hexes and fitted. Creases that leave hexes poor are let go, and all is done again from the smooth fit;
// what is still bad in the end is freed on the spot: features first, then the surface. The best of all rounds is kept.
FeatureFit fit_features(const HexMesh& smooth, const Ground& ground, Context& context);

}  // namespace strata
