// Quality statistics of a hex mesh, defined as the independent referee defines them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

class Context;

inline constexpr int kHistogramBins = 20;  // equal bins over [-1, 1]

struct JacobianStatistics {
  std::int64_t count = 0;
  double min = 1;
  double mean = 0;
  std::int64_t not_positive = 0;
  std::array<std::int64_t, kHistogramBins> histogram{};
};

struct PatchStatistics {
  std::string name;
  std::int32_t reference = 0;        // as in files
  std::int64_t quads = 0;
  double area = 0;                   // input units squared
  JacobianStatistics jacobian;       // hexes touching the patch with a quad
  // layers, when asked for on this patch
  int layers_wished = 0;
  int layers = 0;                    // delivered
  double first_height_wished = 0;    // input units
  double first_height_mean = 0;      // delivered
  double thickness_fraction_mean = 0;  // delivered / wished total thickness, area-weighted
  double thickness_fraction_min = 0;
  double coverage = 0;               // share of the area that carries all layers wished (or ends in a wedge)
};

struct RegionStatistics {
  std::int32_t reference = 0;
  std::int64_t hexes = 0;
  double volume = 0;
  JacobianStatistics jacobian;
};

struct Quality {
  JacobianStatistics all, layers, rest;
  std::vector<RegionStatistics> regions;
  std::vector<PatchStatistics> patches;
  std::int64_t vertices = 0;
  std::int64_t quads = 0;
};

// Scaled Jacobian, Verdict SAND2007-1751: minimum over the 8 corners and the centre of the normalised triple product.
double scaled_jacobian(const std::array<Vec3, 8>& corners);
// Corners only: what the optimiser works on.
double corner_scaled_jacobian(const std::array<Vec3, 8>& corners);

// Statistics of the mesh; fills everything but the wishes and coverage of patches, which grow_layers knows.
Quality measure_quality(const HexMesh& mesh, const IdMap<PatchId, std::string>& patch_names, Context& context);

}  // namespace strata
