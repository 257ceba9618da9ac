#include <algorithm>
#include <cmath>

#include "core/base/context.h"
#include "core/base/parallel.h"
#include "core/mesh/adjacency.h"
#include "core/quality/quality.h"

namespace strata {
namespace {

// Of the trilinear hex, exact: flux of x/3 through its bilinear faces, each of them as the mean of its two ways to be cut into triangles.
double volume_of(const std::array<Vec3, 8>& p) {
  double sum = 0;
  for (const auto& f : kHexFaces) {
    const Vec3 a = p[static_cast<std::size_t>(f[0])] - p[0], b = p[static_cast<std::size_t>(f[1])] - p[0];
    const Vec3 c = p[static_cast<std::size_t>(f[2])] - p[0], d = p[static_cast<std::size_t>(f[3])] - p[0];
    sum += a.cross(b).dot(c) + a.cross(c).dot(d) + a.cross(b).dot(d) + b.cross(c).dot(d);
  }
  return sum / 12;
}

// Of the bilinear quad: half the cross product of the diagonals is exact where it is flat.
double area_of(const HexMesh& mesh, QuadId q) {
  const auto& v = mesh.quads[q];
  return 0.5 * (mesh.position[v[2]] - mesh.position[v[0]]).cross(mesh.position[v[3]] - mesh.position[v[1]]).norm();
}

void add(JacobianStatistics& s, double jacobian) {
  ++s.count;
  s.min = std::min(s.min, jacobian);
  s.mean += jacobian;  // the sum, until finish()
  if (!(jacobian > 0)) ++s.not_positive;
  const int bin = static_cast<int>(std::floor((jacobian + 1) * 0.5 * kHistogramBins));
  ++s.histogram[static_cast<std::size_t>(std::clamp(bin, 0, kHistogramBins - 1))];
}
void finish(JacobianStatistics& s) {
  if (s.count > 0) s.mean /= static_cast<double>(s.count);
}

void measure_hexes(const HexMesh& mesh, const IdMap<HexId, double>& jacobian, const IdMap<HexId, double>& volume, Quality& quality) {
  std::int32_t regions = 0;
  for (const RegionId r : mesh.region) regions = std::max(regions, r.value + 1);
  quality.regions.resize(static_cast<std::size_t>(regions));
  for (std::size_t r = 0; r < quality.regions.size(); ++r) quality.regions[r].reference = static_cast<std::int32_t>(r) + 1;
  for (const HexId h : mesh.hexes.ids()) {
    add(quality.all, jacobian[h]);
    const bool layer = !mesh.layer.empty() && mesh.layer[h] > 0;
    add(layer ? quality.layers : quality.rest, jacobian[h]);
    if (mesh.region.empty() || !mesh.region[h].valid()) continue;
    RegionStatistics& region = quality.regions[mesh.region[h].index()];
    ++region.hexes;
    region.volume += volume[h];
    add(region.jacobian, jacobian[h]);
  }
  for (RegionStatistics& region : quality.regions) finish(region.jacobian);
  for (JacobianStatistics* s : {&quality.all, &quality.layers, &quality.rest}) finish(*s);
}

void measure_patches(const HexMesh& mesh, const IdMap<HexId, double>& jacobian, const IdMap<PatchId, std::string>& names,
                     Quality& quality) {
  quality.patches.resize(names.size());
  for (const PatchId p : names.ids()) {
    quality.patches[p.index()].name = names[p];
    quality.patches[p.index()].reference = p.value + 1;
  }
  const IdMap<QuadId, QuadSides> sides = quad_sides(mesh);
  // A hex with two quads on one patch counts once.
  std::vector<std::vector<HexId>> touching(names.size());
  for (const QuadId q : mesh.quads.ids()) {
    if (mesh.patch.empty() || !mesh.patch[q].valid() || mesh.patch[q].index() >= names.size()) continue;
    PatchStatistics& patch = quality.patches[mesh.patch[q].index()];
    ++patch.quads;
    patch.area += area_of(mesh, q);
    for (const HexId h : {sides[q].back, sides[q].front})
      if (h.valid()) touching[mesh.patch[q].index()].push_back(h);
  }
  for (std::size_t p = 0; p < touching.size(); ++p) {
    auto& hexes = touching[p];
    std::sort(hexes.begin(), hexes.end());
    hexes.erase(std::unique(hexes.begin(), hexes.end()), hexes.end());
    for (const HexId h : hexes) add(quality.patches[p].jacobian, jacobian[h]);
    finish(quality.patches[p].jacobian);
  }
}

}  // namespace

Quality measure_quality(const HexMesh& mesh, const IdMap<PatchId, std::string>& patch_names, Context& context) {
  Quality quality;
  quality.vertices = static_cast<std::int64_t>(mesh.position.size());
  quality.quads = static_cast<std::int64_t>(mesh.quads.size());
  IdMap<HexId, double> jacobian(mesh.hexes.size()), volume(mesh.hexes.size());
  parallel_for(mesh.hexes.size(), [&](std::size_t i) {
    const HexId h(i);
    const std::array<Vec3, 8> p = corners_of(mesh, h);
    jacobian[h] = scaled_jacobian(p);
    volume[h] = volume_of(p);
  });
  context.checkpoint();
  measure_hexes(mesh, jacobian, volume, quality);
  measure_patches(mesh, jacobian, patch_names, quality);
  return quality;
}

}  // namespace strata
