#include "tests/support/mesh_checks.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <sstream>
#include <vector>

#include "core/mesh/adjacency.h"
#include "core/quality/quality.h"

namespace strata::testing {
namespace {

using Key = std::array<std::int32_t, 4>;
using Edge = std::array<std::int32_t, 2>;

Key key_of(const QuadVertices& q) {
  Key k{q[0].value, q[1].value, q[2].value, q[3].value};
  std::sort(k.begin(), k.end());
  return k;
}
Edge edge_of(VertexId a, VertexId b) { return {std::min(a.value, b.value), std::max(a.value, b.value)}; }

bool same_turn(const QuadVertices& a, const QuadVertices& b) {
  for (std::size_t i = 0; i < 4; ++i)
    if (a[0] == b[i]) return a[1] == b[(i + 1) & 3] && a[2] == b[(i + 2) & 3];
  return false;
}
bool opposite_turn(const QuadVertices& a, const QuadVertices& b) { return same_turn(a, {b[0], b[3], b[2], b[1]}); }

struct Face {
  HexId hex;
  QuadVertices vertices;
};
std::map<Key, std::vector<Face>> all_faces(const HexMesh& mesh) {
  std::map<Key, std::vector<Face>> faces;
  for (HexId h : mesh.hexes.ids())
    for (int f = 0; f < 6; ++f) {
      const QuadVertices q = face_vertices(mesh.hexes[h], f);
      faces[key_of(q)].push_back({h, q});
    }
  return faces;
}

template <class... Parts>
std::string say(const Parts&... parts) {
  std::ostringstream out;
  (out << ... << parts);
  return out.str();
}
std::string name(const Key& k) { return say("(", k[0], " ", k[1], " ", k[2], " ", k[3], ")"); }

double corner_determinant(const HexMesh& mesh, HexId h, std::size_t c) {
  const auto p = [&](std::size_t i) -> const Vec3& { return mesh.position[mesh.hexes[h][i]]; };
  const auto& n = kHexCorners[c];
  const auto at = [&](std::size_t i) { return Vec3(p(static_cast<std::size_t>(n[i])) - p(c)); };
  return at(0).cross(at(1)).dot(at(2));
}

}  // namespace

std::string check_conforming(const HexMesh& mesh) {
  if (mesh.region.size() != mesh.hexes.size() || mesh.layer.size() != mesh.hexes.size()) return "hex arrays differ in size";
  if (mesh.attachment.size() != mesh.position.size()) return "vertex arrays differ in size";
  if (mesh.patch.size() != mesh.quads.size() || mesh.chart.size() != mesh.quads.size()) return "quad arrays differ in size";
  for (HexId h : mesh.hexes.ids()) {
    std::set<VertexId> distinct;
    for (VertexId v : mesh.hexes[h]) {
      if (!v.valid() || v.index() >= mesh.position.size()) return say("hex ", h.value, " has a vertex out of range");
      distinct.insert(v);
    }
    if (distinct.size() != 8) return say("hex ", h.value, " repeats a vertex");
  }
  for (const auto& [key, faces] : all_faces(mesh)) {
    if (faces.size() > 2) return say("face ", name(key), " has ", faces.size(), " hexes");
    if (faces.size() == 2 && !opposite_turn(faces[0].vertices, faces[1].vertices))
      return say("face ", name(key), " is seen with equal turns by hexes ", faces[0].hex.value, " and ", faces[1].hex.value);
  }
  return "";
}

std::string check_quads(const HexMesh& mesh) {
  std::map<Key, QuadVertices> quads;
  for (QuadId q : mesh.quads.ids())
    if (!quads.emplace(key_of(mesh.quads[q]), mesh.quads[q]).second) return say("quad ", name(key_of(mesh.quads[q])), " twice");
  std::size_t found = 0;
  for (const auto& [key, faces] : all_faces(mesh)) {
    const bool boundary = faces.size() == 1;
    const bool interface = faces.size() == 2 && mesh.region[faces[0].hex] != mesh.region[faces[1].hex];
    const auto quad = quads.find(key);
    if (!boundary && !interface) {
      if (quad != quads.end()) return say("quad ", name(key), " inside a region");
      continue;
    }
    if (quad == quads.end()) return say(boundary ? "boundary" : "interface", " face ", name(key), " has no quad");
    ++found;
    const bool second = interface && mesh.region[faces[1].hex] < mesh.region[faces[0].hex];
    if (!same_turn(quad->second, faces[second ? 1 : 0].vertices)) return say("quad ", name(key), " points the wrong way");
  }
  if (found != quads.size()) return say(quads.size() - found, " quads lie on no face");
  return "";
}

std::string check_manifold_boundary(const HexMesh& mesh) {
  std::map<Key, std::vector<Face>> all = all_faces(mesh);
  std::set<RegionId> regions(mesh.region.begin(), mesh.region.end());
  for (RegionId region : regions) {
    std::map<Edge, int> edges;
    std::map<std::int32_t, std::vector<Edge>> at_vertex;  // per vertex the two neighbours along each face
    for (const auto& [key, faces] : all)
      for (std::size_t i = 0; i < faces.size(); ++i) {
        if (mesh.region[faces[i].hex] != region) continue;
        if (faces.size() == 2 && mesh.region[faces[1 - i].hex] == region) continue;
        const QuadVertices& q = faces[i].vertices;
        for (std::size_t j = 0; j < 4; ++j) {
          ++edges[edge_of(q[j], q[(j + 1) & 3])];
          at_vertex[q[j].value].push_back({q[(j + 3) & 3].value, q[(j + 1) & 3].value});
        }
      }
    for (const auto& [edge, count] : edges)
      if (count != 2) return say("region ", region.value, ": boundary edge (", edge[0], " ", edge[1], ") has ", count, " faces");
    for (const auto& [vertex, links] : at_vertex) {
      std::set<std::int32_t> reached{links[0][0], links[0][1]};
      for (std::size_t round = 0; round < links.size(); ++round)
        for (const Edge& l : links)
          if (reached.count(l[0]) + reached.count(l[1]) > 0) reached.insert({l[0], l[1]});
      if (reached.size() != links.size()) return say("region ", region.value, ": boundary vertex ", vertex, " has more than one fan");
    }
  }
  return "";
}

std::string check_topology(const HexMesh& mesh) {
  for (const auto& check : {check_conforming, check_quads, check_manifold_boundary})
    if (std::string wrong = check(mesh); !wrong.empty()) return wrong;
  return "";
}

std::int64_t count_not_positive_hexes(const HexMesh& mesh) {
  std::int64_t count = 0;
  for (HexId h : mesh.hexes.ids()) {
    bool positive = true;
    for (std::size_t c = 0; c < 8; ++c) positive = positive && corner_determinant(mesh, h, c) > 0;
    if (!positive) ++count;
  }
  return count;
}

CornerJacobians corner_jacobians(const HexMesh& mesh) {
  CornerJacobians result;
  for (const HexVertices& hex : mesh.hexes) {
    std::array<Vec3, 8> p;
    for (std::size_t c = 0; c < 8; ++c) p[c] = mesh.position[hex[c]];
    const double jacobian = corner_scaled_jacobian(p);
    result.min = std::min(result.min, jacobian);
    result.mean += jacobian / static_cast<double>(mesh.hexes.size());
  }
  return result;
}

std::string check_positive(const HexMesh& mesh) {
  const std::int64_t count = count_not_positive_hexes(mesh);
  return count == 0 ? "" : say(count, " of ", mesh.hexes.size(), " hexes are not positive");
}

std::string check_quads_per_hex(const HexMesh& mesh, int most) {
  std::vector<int> count(mesh.hexes.size(), 0);
  for (const QuadSides& sides : quad_sides(mesh))
    for (HexId h : {sides.back, sides.front})
      if (h.valid() && ++count[h.index()] > most) return say("hex ", h.value, " has more than ", most, " quads");
  return "";
}

namespace {

std::string check_borders(const HexMesh& mesh, const ChartId* only) {
  std::map<Edge, std::set<ChartId>> charts;
  for (QuadId q : mesh.quads.ids())
    for (std::size_t i = 0; i < 4; ++i) charts[edge_of(mesh.quads[q][i], mesh.quads[q][(i + 1) & 3])].insert(mesh.chart[q]);
  for (QuadId q : mesh.quads.ids()) {
    if (only != nullptr && mesh.chart[q] != *only) continue;
    std::array<bool, 4> border{};
    const QuadVertices& v = mesh.quads[q];
    for (std::size_t i = 0; i < 4; ++i) border[i] = charts[edge_of(v[i], v[(i + 1) & 3])].size() > 1;
    for (std::size_t i = 0; i < 4; ++i) {
      if (!border[i]) continue;
      if (border[(i + 2) & 3]) return say("quad ", q.value, " has opposite border edges");
      if (border[(i + 1) & 3] && mesh.attachment[v[(i + 1) & 3]].hold != Hold::Corner)
        return say("quad ", q.value, " has two border edges at vertex ", v[(i + 1) & 3].value, ", which is no corner");
    }
  }
  return "";
}

}  // namespace

std::string check_one_border_edge_per_quad(const HexMesh& mesh) { return check_borders(mesh, nullptr); }
std::string check_one_border_edge_per_quad(const HexMesh& mesh, ChartId chart) { return check_borders(mesh, &chart); }

double hex_volume(const HexMesh& mesh) {
  // Divergence theorem over the faces, each cut in four triangles at its centre: exact for flat faces, consistent between neighbours.
  double volume = 0;
  for (HexId h : mesh.hexes.ids())
    for (int f = 0; f < 6; ++f) {
      const QuadVertices q = face_vertices(mesh.hexes[h], f);
      Vec3 centre = Vec3::Zero();
      for (VertexId v : q) centre += 0.25 * mesh.position[v];
      for (std::size_t i = 0; i < 4; ++i) volume += mesh.position[q[i]].cross(mesh.position[q[(i + 1) & 3]]).dot(centre) / 6;
    }
  return volume;
}

std::int64_t euler_of_boundary(const HexMesh& mesh) {
  std::set<std::int32_t> vertices;
  std::set<Edge> edges;
  std::int64_t faces = 0;
  for (const auto& [key, owners] : all_faces(mesh)) {
    if (owners.size() != 1) continue;
    ++faces;
    const QuadVertices& q = owners[0].vertices;
    for (std::size_t i = 0; i < 4; ++i) {
      vertices.insert(q[i].value);
      edges.insert(edge_of(q[i], q[(i + 1) & 3]));
    }
  }
  return static_cast<std::int64_t>(vertices.size()) - static_cast<std::int64_t>(edges.size()) + faces;
}

std::int64_t quads_labelled(const HexMesh& mesh, ChartId chart) { return std::count(mesh.chart.begin(), mesh.chart.end(), chart); }

}  // namespace strata::testing
