// Scenes for the layer tests: a surface, its features, and a hex mesh that fits it exactly, labelled and attached.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "core/base/context.h"
#include "core/features/features.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"
#include "core/optimise/ground.h"
#include "core/spec/mesh_spec.h"
#include "core/surface/surface.h"
#include "tests/support/grids.h"
#include "tests/support/shapes.h"

namespace strata::testing {

struct LayerScene {
  Context context;
  Surface surface;
  Features features;
  Ground ground;
  HexMesh mesh;

  explicit LayerScene(TriangleSoup soup)
      : surface(condition(std::move(soup), context)), features(detect_features(surface, {}, context)), ground(surface, features) {}
  LayerScene(const LayerScene&) = delete;

  [[nodiscard]] PatchId patch(const std::string& name) const {
    for (PatchId p : surface.patch_names.ids())
      if (surface.patch_names[p] == name) return p;
    return {};
  }
};

// Labels by the closest triangle that looks the same way, attachments by the charts round each vertex.
inline void label(LayerScene& scene) {
  HexMesh& mesh = scene.mesh;
  const Features& features = scene.features;
  for (QuadId q : mesh.quads.ids()) {
    const QuadVertices& v = mesh.quads[q];
    const Vec3 normal = (mesh.position[v[2]] - mesh.position[v[0]]).cross(mesh.position[v[3]] - mesh.position[v[1]]).normalized();
    const Vec3 centre = 0.25 * (mesh.position[v[0]] + mesh.position[v[1]] + mesh.position[v[2]] + mesh.position[v[3]]);
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < features.chart_count(); ++c) {
      const Foothold at = scene.ground.project({Hold::Chart, static_cast<std::int32_t>(c)}, centre);
      const double cost = (at.position - centre).norm() + (1 - at.direction.dot(normal));
      if (cost < best) best = cost, mesh.chart[q] = ChartId(c);
    }
    mesh.patch[q] = features.patch_of_chart[mesh.chart[q]];
  }
  const VertexStars<QuadId> stars = quads_round_vertices(mesh);
  for (VertexId v : mesh.position.ids()) {
    std::vector<ChartId> charts;
    for (QuadId q : stars.of(v)) charts.push_back(mesh.chart[q]);
    std::sort(charts.begin(), charts.end());
    charts.erase(std::unique(charts.begin(), charts.end()), charts.end());
    Attachment& held = mesh.attachment[v];
    held = {};
    if (charts.size() == 1) held = {Hold::Chart, charts[0].value};
    double best = std::numeric_limits<double>::infinity();
    if (charts.size() == 2)
      for (CurveId c : features.curves.ids()) {
        const Curve& curve = features.curves[c];
        if (std::minmax(curve.left, curve.right) != std::minmax(charts[0], charts[1])) continue;
        const double d = (scene.ground.project({Hold::Curve, c.value}, mesh.position[v]).position - mesh.position[v]).norm();
        if (d < best) best = d, held = {Hold::Curve, c.value};
      }
    if (charts.size() > 2)
      for (CornerId c : features.corners.ids())
        if (const double d = (scene.surface.points[features.corners[c].point] - mesh.position[v]).norm(); d < best)
          best = d, held = {Hold::Corner, c.value};
    mesh.position[v] = scene.ground.project(held, mesh.position[v]).position;
  }
}

inline std::unique_ptr<LayerScene> cube_scene(int n) {
  auto scene = std::make_unique<LayerScene>(test::cube(n));
  scene->mesh = grid(n, n, n);
  for (Vec3& p : scene->mesh.position) p = scene->surface.frame.to_work(p / n);
  label(*scene);
  return scene;
}

// An O-grid: a square core of n x n columns, four wings of n x `rings` columns, `levels` slabs.
inline std::unique_ptr<LayerScene> cylinder_scene(int n, int rings, int levels, double height = 2) {
  auto scene = std::make_unique<LayerScene>(test::cylinder(4 * n * 4, height, levels));
  HexMesh& mesh = scene->mesh;
  const int around = 4 * n;
  std::vector<Vec3> flat;
  std::vector<std::array<int, 4>> cells;
  const auto core = [&](int i, int j) { return j * (n + 1) + i; };
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) flat.emplace_back((2.0 * i / n - 1) * 0.45, (2.0 * j / n - 1) * 0.45, 0);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) cells.push_back({core(i, j), core(i + 1, j), core(i + 1, j + 1), core(i, j + 1)});
  // Once round the core, from its lower left corner.
  const auto rim = [&](int k) {
    k = (k % around + around) % around;
    const int side = k / n, i = k % n;
    switch (side) {
      case 0: return core(i, 0);
      case 1: return core(n, i);
      case 2: return core(n - i, n);
      default: return core(0, n - i);
    }
  };
  const int first = static_cast<int>(flat.size());
  const auto ring = [&](int k, int r) { return r == 0 ? rim(k) : first + (r - 1) * around + (k % around + around) % around; };
  for (int r = 1; r <= rings; ++r)
    for (int k = 0; k < around; ++k) {
      const double a = -0.75 * std::numbers::pi + 2 * std::numbers::pi * k / around, t = static_cast<double>(r) / rings;
      flat.push_back((1 - t) * flat[static_cast<std::size_t>(rim(k))] + t * Vec3(std::cos(a), std::sin(a), 0));
    }
  for (int r = 0; r < rings; ++r)
    for (int k = 0; k < around; ++k) cells.push_back({ring(k, r), ring(k, r + 1), ring(k + 1, r + 1), ring(k + 1, r)});
  const int plane = static_cast<int>(flat.size());
  for (int z = 0; z <= levels; ++z)
    for (const Vec3& p : flat) {
      mesh.position.push_back(scene->surface.frame.to_work(p + Vec3(0, 0, height * z / levels)));
      mesh.attachment.push_back({});
    }
  for (int z = 0; z < levels; ++z)
    for (const auto& c : cells) {
      HexVertices hex;
      for (std::size_t i = 0; i < 4; ++i) hex[i] = VertexId(c[i] + z * plane), hex[i + 4] = VertexId(c[i] + (z + 1) * plane);
      mesh.hexes.push_back(hex);
      mesh.region.push_back(RegionId(0));
      mesh.layer.push_back(0);
    }
  set_quads(mesh);
  label(*scene);
  return scene;
}

inline LayerSpec layers_on(std::vector<std::string> patches, int count, double first_height, double growth, Ending ending) {
  LayerSpec spec;
  spec.patches = std::move(patches);
  spec.count = count;
  spec.first_height = first_height;
  spec.growth = growth;
  spec.ending = ending;
  spec.blending = Blending::None;
  return spec;
}

}  // namespace strata::testing
