// Topology and validity of a hex mesh, checked the slow and obvious way. An empty string means the property holds; otherwise it says
// what is wrong and where, so that tests read EXPECT_EQ(check_conforming(mesh), "").
#pragma once

#include <cstdint>
#include <string>

#include "core/mesh/hex_mesh.h"

namespace strata::testing {

// Eight distinct vertices per hex; a face has at most two hexes, which see it with opposite turns; ids in range; arrays of one size.
std::string check_conforming(const HexMesh& mesh);
// The quads are exactly the faces with one hex (normal outwards) and the faces between two regions (once, out of the smaller region).
std::string check_quads(const HexMesh& mesh);
// Per region: two boundary faces at every boundary edge, and one fan of boundary faces round every boundary vertex.
std::string check_manifold_boundary(const HexMesh& mesh);
// The three above.
std::string check_topology(const HexMesh& mesh);
// Every corner determinant of every hex is positive.
std::string check_positive(const HexMesh& mesh);
std::int64_t count_not_positive_hexes(const HexMesh& mesh);
// Scaled Jacobians of all hexes, at their corners.
struct CornerJacobians {
  double min = 1, mean = 0;
};
CornerJacobians corner_jacobians(const HexMesh& mesh);
// No hex has more than `most` faces that are quads of the mesh.
std::string check_quads_per_hex(const HexMesh& mesh, int most);
// Quads of two charts share at most one edge; no quad has two border edges unless they meet at a vertex held at a corner.
std::string check_one_border_edge_per_quad(const HexMesh& mesh);
// The same for the quads of one chart.
std::string check_one_border_edge_per_quad(const HexMesh& mesh, ChartId chart);

double hex_volume(const HexMesh& mesh);                      // sum over hexes, each cut in tetrahedra
std::int64_t euler_of_boundary(const HexMesh& mesh);         // V - E + F of the faces with one hex
std::int64_t quads_labelled(const HexMesh& mesh, ChartId chart);

}  // namespace strata::testing
