// Structured hex meshes for tests.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <random>

#include "core/dual/dual.h"
#include "core/mesh/hex_mesh.h"
#include "core/surface/locator.h"

namespace strata::testing {

// Cells of the unit-spaced grid [0,x] x [0,y] x [0,z], those for which `keep` holds (all when empty), with region 0. Unused vertices are
// dropped. Boundary quads are labelled with chart = patch = the side they face: 0 z-, 1 z+, 2 y-, 3 y+, 4 x-, 5 x+ (mesh/hex.h).
using KeepCell = std::function<bool(int x, int y, int z)>;
HexMesh grid(int x, int y, int z, const KeepCell& keep = {});
// The same with a region per cell; negative: no cell. Interface quads get chart and patch 6.
using RegionOfCell = std::function<int(int x, int y, int z)>;
HexMesh grid_of_regions(int x, int y, int z, const RegionOfCell& region);
// An n x n x n grid with about a quarter of its cells removed at random, such that what remains is connected and has a 2-manifold boundary.
HexMesh random_solid(int n, std::mt19937& random);
// n x n x n cells over [-0.8, 0.8]^3, moved by `shift`, as the dual of a uniform octree is; cut where the surface is near.
Dual uniform_dual(const Locator& locator, int n, const Vec3& shift);
// The quads as they should be: boundary faces and interfaces, oriented as HexMesh asks, labels invalid.
void set_quads(HexMesh& mesh);

}  // namespace strata::testing
