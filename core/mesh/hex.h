// The one drawing of a hexahedron. VTK and GMF share this numbering.
//
//          7--------6        corner i sits at (x,y,z) of the unit cube:
//         /|       /|          0 (0,0,0)  1 (1,0,0)  2 (1,1,0)  3 (0,1,0)
//        4--------5 |          4 (0,0,1)  5 (1,0,1)  6 (1,1,1)  7 (0,1,1)
//        | 3------|-2
//        |/       |/         A hex is positive when (1-0)x(3-0).(4-0) > 0, and so at every corner.
//        0--------1          z up, x right, y into the page.
#pragma once

#include <array>
#include <cstdint>

namespace strata {

// The corners of each face, counter-clockwise seen from outside (the normal points out of a positive hex).
// Face 2k and 2k+1 are opposite: 0 z=0, 1 z=1, 2 y=0, 3 y=1, 4 x=0, 5 x=1.
inline constexpr std::array<std::array<std::int8_t, 4>, 6> kHexFaces{{
    {0, 3, 2, 1},
    {4, 5, 6, 7},
    {0, 1, 5, 4},
    {3, 7, 6, 2},
    {0, 4, 7, 3},
    {1, 2, 6, 5},
}};

// The three corners joined to each corner by an edge, right-handed: (n0-c)x(n1-c).(n2-c) > 0 in a positive hex.
inline constexpr std::array<std::array<std::int8_t, 3>, 8> kHexCorners{{
    {1, 3, 4},
    {2, 0, 5},
    {3, 1, 6},
    {0, 2, 7},
    {7, 5, 0},
    {4, 6, 1},
    {5, 7, 2},
    {6, 4, 3},
}};

// The twelve edges: 0-3 along x, 4-7 along y, 8-11 along z.
inline constexpr std::array<std::array<std::uint8_t, 2>, 12> kHexEdges{{
    {0, 1},
    {3, 2},
    {4, 5},
    {7, 6},
    {0, 3},
    {1, 2},
    {4, 7},
    {5, 6},
    {0, 4},
    {1, 5},
    {3, 7},
    {2, 6},
}};

inline constexpr int opposite_face(int face) { return face ^ 1; }

}  // namespace strata
