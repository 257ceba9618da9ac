// The transition patterns: how a block is cut into sub-cells so that the dual of the whole octree has only hexes.
//
// Every leaf block has 2x2x2 cells. A block whose neighbours are finer replaces cells by templates (Livesu, Pitzalis, Cherchi,
// "Optimal Dual Schemes for Adaptive Grid Based Hexmeshing", ACM TOG 2021, placed per block by search). The rule they obey: seen
// from a point of its boundary, a block shows as many cells as if it were as fine as its neighbour there, so that every interior
// point has eight cells, joined like the corners of a cube.
//
// What a block draws on its boundary depends on 18 bits, known alike to both blocks of a face:
//   face bit   the neighbour across the face is finer: the face is cut in 4x4
//   edge bit   one of the other three blocks round the block's edge is finer: a small triangle is cut at the edge's midpoint in
//              both faces (implied where a face bit is set)
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/vec3.h"

namespace strata {

// Face 2a is the low side along axis a, 2a+1 the high side. Edge 4a + s + 2t runs along axis a; s and t say whether it lies on the
// high side of the two other axes, in the order x before y before z.
using PatternBits = std::uint32_t;
inline constexpr int kFaceBits = 6;
inline constexpr int kEdgeBits = 12;
inline constexpr PatternBits face_bit(int face) { return PatternBits{1} << face; }
inline constexpr PatternBits edge_bit(int edge) { return PatternBits{1} << (kFaceBits + edge); }
inline constexpr std::size_t kPatternBitSets = std::size_t{1} << (kFaceBits + kEdgeBits);
// Sets the edge bits that face bits imply.
PatternBits with_implied_edges(PatternBits bits);

// Quarters of the block's edge: every vertex on the block's boundary sits on this 5x5x5 lattice.
inline constexpr int kQuarters = 4;
inline constexpr std::size_t kLattice = 125;
struct LatticePoint {
  std::int8_t x = 0, y = 0, z = 0;
};
inline constexpr std::size_t lattice_index(int x, int y, int z) { return static_cast<std::size_t>(x + 5 * (y + 5 * z)); }

// One way to cut a block.
struct Pattern {
  std::vector<Vec3> node;                            // per sub-cell: mean of its vertices, block = unit cube
  std::vector<std::array<std::int8_t, 8>> interior;  // dual hexes of the vertices inside the block: sub-cells, numbered as mesh/hex.h
  std::vector<LatticePoint> owned;                   // vertices on the low faces but not on the high ones, low corner included
  // For each vertex on the boundary, the sub-cell that fills the octant (x lowest bit; 1: the high side) round it; -1: none.
  std::array<std::array<std::int8_t, 8>, kLattice> octant{};
};

// The hex corner that lies in each octant round the vertex the hex is dual to.
inline constexpr std::array<std::uint8_t, 8> kOctantOfCorner{0, 1, 3, 2, 4, 5, 7, 6};

// The patterns of the given bit sets, solved in parallel. Deterministic.
std::vector<Pattern> solve_patterns(const std::vector<PatternBits>& bits);

}  // namespace strata
