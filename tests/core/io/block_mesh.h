// A structured block of hexes with its boundary quads: one patch a side; two regions, with the quads between them as patch 6;
// layers counted from z = 0.
#pragma once

#include <array>
#include <utility>

#include "core/mesh/hex.h"
#include "core/mesh/hex_mesh.h"

namespace strata::test {

inline HexMesh block_mesh(int nx, int ny, int nz) {
  HexMesh mesh;
  const auto vertex = [&](int i, int j, int k) { return VertexId(static_cast<std::int32_t>((k * (ny + 1) + j) * (nx + 1) + i)); };
  for (int k = 0; k <= nz; ++k)
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i) mesh.position.push_back(Vec3(double(i) / nx, double(j) / ny, double(k) / nz));
  mesh.attachment.resize(mesh.position.size());
  const std::array<std::array<int, 3>, 8> corner{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        HexVertices hex;
        for (std::size_t c = 0; c < 8; ++c) hex[c] = vertex(i + corner[c][0], j + corner[c][1], k + corner[c][2]);
        mesh.hexes.push_back(hex);
        mesh.region.push_back(RegionId(i < nx / 2 ? 0 : 1));
        mesh.layer.push_back(static_cast<std::uint16_t>(k < 2 ? k + 1 : 0));
        const std::array<bool, 6> outer{k == 0, k == nz - 1, j == 0, j == ny - 1, i == 0, i == nx - 1};
        const bool interface = i == nx / 2 - 1;
        for (std::size_t f = 0; f < 6; ++f) {
          if (!outer[f] && !(interface && f == 5)) continue;
          QuadVertices quad;
          for (std::size_t c = 0; c < 4; ++c) quad[c] = hex[static_cast<std::size_t>(kHexFaces[f][c])];
          mesh.quads.push_back(quad);
          mesh.patch.push_back(PatchId(outer[f] ? static_cast<std::int32_t>(f) : 6));
          mesh.chart.push_back(ChartId(mesh.patch.values().back().value));
        }
      }
  return mesh;
}

}  // namespace strata::test
