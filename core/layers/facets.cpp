#include "core/layers/facets.h"

#include <cmath>

#include "core/base/parallel.h"

namespace strata {
namespace {

constexpr int kMostHexesRoundEdge = 64;  // a guard against broken meshes, far above any sane valence

bool has_edge(const QuadVertices& q, VertexId a, VertexId b) {
  for (std::size_t i = 0; i < 4; ++i) {
    const VertexId u = q[i], v = q[(i + 1) & 3];
    if ((u == a && v == b) || (u == b && v == a)) return true;
  }
  return false;
}

int other_face(const HexVertices& hex, int face, VertexId a, VertexId b) {
  for (int f = 0; f < 6; ++f)
    if (f != face && has_edge(face_vertices(hex, f), a, b)) return f;
  return -1;
}

// From the middle of the edge towards the middle of the opposite edge of the quad: the same seen from both hexes of a face, so angles
// round an edge add up.
Vec3 across(const HexMesh& mesh, const QuadVertices& q, VertexId a, VertexId b) {
  Vec3 centre = Vec3::Zero();
  for (VertexId v : q)
    if (v != a && v != b) centre += 0.5 * mesh.position[v];
  return centre - 0.5 * (mesh.position[a] + mesh.position[b]);
}

double angle_between(const Vec3& axis, const Vec3& u, const Vec3& v) {
  const Vec3 pu = u - axis * axis.dot(u), pv = v - axis * axis.dot(v);
  return std::atan2(pu.cross(pv).norm(), pu.dot(pv));
}

}  // namespace

Facets::Facets(const HexMesh& mesh, const std::vector<QuadId>& bare) : mesh_(&mesh), bare_(bare), sides_(quad_sides(mesh)) {}

JoinedFacets::JoinedFacets(const HexMesh& mesh, const std::vector<QuadId>& bare)
    : Facets(mesh, bare),
      neighbours_(face_neighbours(mesh)),
      facet_at_(mesh.hexes.size(), {kNoFacet, kNoFacet, kNoFacet, kNoFacet, kNoFacet, kNoFacet}) {
  for (FacetIndex f = 0; f < static_cast<FacetIndex>(slots()); ++f)
    if (const FaceNeighbour at = hex_face(f); at.hex.valid()) facet_at_[at.hex][static_cast<std::size_t>(at.face)] = f;
}

FaceNeighbour Facets::hex_face(FacetIndex facet) const {
  const QuadSides& s = sides_[quad_of(facet)];
  return side_of(facet) == FacetSide::Back ? FaceNeighbour{s.back, s.back_face} : FaceNeighbour{s.front, s.front_face};
}

QuadVertices Facets::vertices(FacetIndex facet) const {
  const FaceNeighbour at = hex_face(facet);
  return face_vertices(mesh_->hexes[at.hex], at.face);
}

FacetNeighbour JoinedFacets::neighbour(FacetIndex facet, int edge) const {
  FaceNeighbour at = hex_face(facet);
  const QuadVertices q = vertices(facet);
  const VertexId a = q[static_cast<std::size_t>(edge)], b = q[static_cast<std::size_t>((edge + 1) & 3)];
  const Vec3 axis = (mesh_->position[b] - mesh_->position[a]).normalized();
  FacetNeighbour result;
  for (int turn = 0; turn < kMostHexesRoundEdge; ++turn) {
    const HexVertices& hex = mesh_->hexes[at.hex];
    const int face = other_face(hex, at.face, a, b);
    if (face < 0) return {};
    result.angle += angle_between(axis, across(*mesh_, face_vertices(hex, at.face), a, b), across(*mesh_, face_vertices(hex, face), a, b));
    result.facet = facet_at_[at.hex][static_cast<std::size_t>(face)];
    if (result.facet != kNoFacet) return result;
    at = neighbours_[at.hex][static_cast<std::size_t>(face)];
    if (!at.hex.valid()) return {};
  }
  return {};
}

}  // namespace strata
