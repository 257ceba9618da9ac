// What was asked for: the specification format of docs/formats.md as values, lengths in input units, angles in radians.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/diagnostic.h"
#include "core/base/vec3.h"

namespace strata {

enum class VolumeMode {
  Points,     // each closed region that holds one of the points, references 1, 2, ... in their order
  All,        // every bounded region
  Outermost,  // the outermost shell's region, inner cavities not meshed
  Solid,      // everything inside the outermost shell as one region
};
struct VolumeSpec {
  VolumeMode mode = VolumeMode::All;
  std::vector<Vec3> points;
};

struct PatchSize {
  std::vector<std::string> patches;  // names with * and ?
  double size = 0;                   // target edge length of the surface quads
};
struct BoxSize {
  Vec3 min, max;
  double size = 0;
};
struct SphereSize {
  Vec3 centre;
  double radius = 0;
  double size = 0;
};
struct CylinderSize {
  Vec3 from, to;
  double radius = 0;
  double size = 0;
};
struct CurveSize {
  std::vector<std::string> between;  // one or two patterns: the patches on either side
  double size = 0;
};
struct SizeMap {
  Vec3 min, max;
  std::vector<int> counts;           // nodes along x, y, z
  std::vector<double> sizes;         // at the nodes, x running fastest
};

struct SizingSpec {
  std::optional<double> max_size;    // bound for every cell; default: longest side of the bounding box / 16
  std::optional<double> min_size;
  std::vector<PatchSize> patches;    // the first entry that matches a patch rules
  std::optional<double> curvature;   // largest turn of the surface per element, radians
  std::optional<double> gap_cells;   // cells wanted across a gap or a wall
  std::vector<BoxSize> boxes;
  std::vector<SphereSize> spheres;
  std::vector<CylinderSize> cylinders;
  std::vector<CurveSize> curves;
  std::optional<SizeMap> background; // refines, never coarsens
  std::optional<int> min_level, max_level;  // octree depths: cells of the longest side / 2^level; sizes overrule them
  double gradation = 2;              // cells grow by at most (gradation - 1) times the distance; 2 is what the octree's balance gives
  std::optional<std::int64_t> max_cells;
};

enum class SharpEdges { Exact, Fillet, Auto };  // Auto: exact
struct FeatureSpec {
  double ridge_angle = 0.6981317007977318;  // 40 degrees
  SharpEdges sharp_edges = SharpEdges::Auto;
};

enum class Ending { Auto, Wedge, Imprint, CrossImprint, Regular };
enum class GiveUp { Growth, FirstHeight, Count };
struct NeighbourEnding {
  std::vector<std::string> patches;
  Ending ending = Ending::Auto;
};
enum class Blending { Auto, None, Count };
struct LayerSpec {
  std::vector<std::string> patches;
  std::optional<int> count;
  std::optional<double> first_height;
  std::optional<double> last_height;
  std::optional<double> total_thickness;
  std::optional<double> growth;
  bool relative = false;              // heights in local surface sizes
  Ending ending = Ending::Auto;
  std::vector<NeighbourEnding> neighbours;
  bool push_wedge = false;            // wedges end one row of quads beyond the patches
  std::optional<int> side;            // region reference (1-based) for interfaces; empty: both
  Blending blending = Blending::Auto;
  int blending_count = 0;             // with Blending::Count
  std::vector<GiveUp> give_up;        // order; empty: keep the count, shrink the heights
  int minimum_count = 1;              // layers that Count leaves at least
};

struct MeshSpec {
  VolumeSpec volume;
  SizingSpec sizing;
  FeatureSpec features;
  std::vector<LayerSpec> layers;
  std::uint64_t seed = 0;
};

// The layer heights an entry resolves to: any sufficient set of count, first, last, total, growth.
struct ResolvedLayers {
  int count = 0;
  double first_height = 0;
  double growth = 1;
  [[nodiscard]] double total() const;
  [[nodiscard]] double height(int i) const;  // of layer i = 0 .. count-1
};
// Throws MeshError(InvalidInput, SpecInvalid) when the set is insufficient or contradictory. `field` names the entry.
ResolvedLayers resolve(const LayerSpec& layers, const std::string& field);

// Everything wrong with a specification, given the surface's patch names: ranges, unknown patches (with a did-you-mean), a patch in
// two entries. Empty: usable.
std::vector<Diagnostic> check(const MeshSpec& spec, const std::vector<std::string>& patch_names);

// Glob match with * and ?.
bool matches(const std::string& pattern, const std::string& name);

}  // namespace strata
