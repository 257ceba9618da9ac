#include "tests/support/grids.h"

#include <algorithm>
#include <vector>

#include "core/mesh/adjacency.h"
#include "tests/support/mesh_checks.h"

namespace strata::testing {
namespace {

int side_of(const HexMesh& mesh, const QuadVertices& q) {
  const Vec3 n = (mesh.position[q[2]] - mesh.position[q[0]]).cross(mesh.position[q[3]] - mesh.position[q[1]]);
  int axis = 0;
  n.cwiseAbs().maxCoeff(&axis);
  return 2 * (2 - axis) + (n[axis] > 0 ? 1 : 0);
}

}  // namespace

void set_quads(HexMesh& mesh) {
  mesh.quads.clear();
  const FaceNeighbours neighbours = face_neighbours(mesh);
  for (HexId h : mesh.hexes.ids())
    for (int f = 0; f < 6; ++f) {
      const HexId other = neighbours[h][static_cast<std::size_t>(f)].hex;
      if (other.valid() && mesh.region[other] <= mesh.region[h]) continue;
      mesh.quads.push_back(face_vertices(mesh.hexes[h], f));
    }
  mesh.patch.assign(mesh.quads.size(), PatchId{});
  mesh.chart.assign(mesh.quads.size(), ChartId{});
}

HexMesh grid_of_regions(int nx, int ny, int nz, const RegionOfCell& region) {
  HexMesh mesh;
  IdMap<VertexId, VertexId> renumbered(static_cast<std::size_t>((nx + 1) * (ny + 1) * (nz + 1)));
  const auto vertex = [&](int x, int y, int z) {
    VertexId& v = renumbered[VertexId((z * (ny + 1) + y) * (nx + 1) + x)];
    if (!v.valid()) {
      v = mesh.position.push_back(Vec3(x, y, z));
      mesh.attachment.push_back({});
    }
    return v;
  };
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) {
        const int r = region(x, y, z);
        if (r < 0) continue;
        mesh.hexes.push_back({vertex(x, y, z), vertex(x + 1, y, z), vertex(x + 1, y + 1, z), vertex(x, y + 1, z), vertex(x, y, z + 1),
                              vertex(x + 1, y, z + 1), vertex(x + 1, y + 1, z + 1), vertex(x, y + 1, z + 1)});
        mesh.region.push_back(RegionId(r));
        mesh.layer.push_back(0);
      }
  set_quads(mesh);
  const IdMap<QuadId, QuadSides> sides = quad_sides(mesh);
  for (QuadId q : mesh.quads.ids()) {
    const int side = sides[q].front.valid() ? 6 : side_of(mesh, mesh.quads[q]);
    mesh.chart[q] = ChartId(side);
    mesh.patch[q] = PatchId(side);
  }
  return mesh;
}

HexMesh grid(int x, int y, int z, const KeepCell& keep) {
  return grid_of_regions(x, y, z, [&](int i, int j, int k) { return !keep || keep(i, j, k) ? 0 : -1; });
}

HexMesh random_solid(int n, std::mt19937& random) {
  std::vector<char> kept(static_cast<std::size_t>(n * n * n), 1);
  const auto make = [&] {
    return grid(n, n, n, [&](int x, int y, int z) { return kept[static_cast<std::size_t>((z * n + y) * n + x)] != 0; });
  };
  std::uniform_int_distribution<std::size_t> any(0, kept.size() - 1);
  for (int tries = 0; tries < n * n * n / 4; ++tries) {
    const std::size_t i = any(random);
    if (kept[i] == 0) continue;
    kept[i] = 0;
    const HexMesh mesh = make();
    // One piece: every hex is reached from the first over faces.
    const FaceNeighbours neighbours = face_neighbours(mesh);
    std::vector<char> reached(mesh.hexes.size(), 0);
    std::vector<HexId> todo{HexId(0)};
    reached[0] = 1;
    std::size_t count = 0;
    while (!todo.empty()) {
      const HexId h = todo.back();
      todo.pop_back();
      ++count;
      for (const FaceNeighbour& f : neighbours[h])
        if (f.hex.valid() && reached[f.hex.index()] == 0) {
          reached[f.hex.index()] = 1;
          todo.push_back(f.hex);
        }
    }
    if (count != mesh.hexes.size() || !check_manifold_boundary(mesh).empty()) kept[i] = 1;
  }
  return make();
}

Dual uniform_dual(const Locator& locator, int n, const Vec3& shift) {
  Dual dual;
  dual.mesh = grid(n, n, n);
  dual.mesh.quads.clear();
  dual.mesh.patch.clear();
  dual.mesh.chart.clear();
  dual.mesh.region.assign(dual.mesh.hexes.size(), RegionId());
  const double size = 1.6 / n;
  dual.cell_size.assign(dual.mesh.position.size(), static_cast<float>(size));
  dual.cut.resize(dual.mesh.position.size());
  for (VertexId v : dual.mesh.position.ids()) {
    Vec3& p = dual.mesh.position[v];
    p = Vec3::Constant(-0.8) + shift + size * p;
    dual.cut[v] = locator.closest(p, 4 * size).triangle.valid();
  }
  return dual;
}

}  // namespace strata::testing
