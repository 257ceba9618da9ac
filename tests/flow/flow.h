// Runs of the whole door on small shapes, and what every outcome must satisfy.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "core/mesher.h"
#include "tests/support/shapes.h"

namespace strata::testing {

constexpr double kDegree = std::numbers::pi / 180;

inline MeshSpec sized(double size) {
  MeshSpec spec;
  spec.sizing.max_size = size;
  return spec;
}

// Cells do not turn with the part: a box of sizes, though it asks for nothing, stands along the input's axes.
inline MeshSpec along_input(MeshSpec spec) {
  spec.sizing.boxes.push_back({Vec3::Constant(-1), Vec3::Constant(1), 1e3});
  return spec;
}

inline LayerSpec layers_of(std::vector<std::string> patches, int count, double first_height, Ending ending = Ending::Auto,
                           double growth = 1.2) {
  LayerSpec layer;
  layer.patches = std::move(patches);
  layer.count = count;
  layer.first_height = first_height;
  layer.growth = growth;
  layer.ending = ending;
  layer.blending = Blending::None;
  return layer;
}

inline MeshSpec with_layers(MeshSpec spec, LayerSpec layer) {
  spec.layers.push_back(std::move(layer));
  return spec;
}

inline Outcome run(TriangleSoup soup, const MeshSpec& spec) {
  Context context;
  return generate(std::move(soup), spec, context);
}

// Conforming, positive, quads right, figures of the report those of the mesh.
void expect_sound(const Outcome& outcome);

// Of the soup, by the divergence theorem; shells that point inwards count negative.
double volume_of(const TriangleSoup& soup);
double area_of(const TriangleSoup& soup, const std::string& patch);
double diagonal_of(const TriangleSoup& soup);

// Sum over all regions.
double meshed_volume(const Outcome& outcome);
const PatchStatistics& patch(const Outcome& outcome, const std::string& name);
std::int64_t quads_of(const Outcome& outcome, const std::vector<std::string>& patches);
std::int64_t layer_hexes(const Outcome& outcome);

// Every patch of the soup is there, with its area.
void expect_patches_kept(const Outcome& outcome, const TriangleSoup& soup, double tolerance);
// Some boundary vertex of the mesh lies within `tolerance` of p.
double distance_to_vertices(const Outcome& outcome, const Vec3& p);
// The length of the quad edges between quads of patches a and b.
double border_length(const Outcome& outcome, const std::string& a, const std::string& b);

// Positions, numbering, labels: all that files hold.
bool same_bytes(const HexMesh& a, const HexMesh& b);

}  // namespace strata::testing
