// The binary form of Medit files, GMF .meshb: int32 1 (tells the byte order), int32 version, then blocks of
// { int32 keyword, position of the next block, data }. Counts and indices are 4 bytes, 8 in version 4; positions 4 bytes, 8 from
// version 3; reals floats in version 1, doubles from version 2.
#pragma once

#include <cstdint>

namespace strata::io {

enum class GmfKeyword : std::int32_t {
  Dimension = 3,
  Vertices = 4,
  Triangles = 6,
  Quadrilaterals = 7,
  Hexahedra = 10,
  End = 54,
  SolAtHexahedra = 68,
};

}  // namespace strata::io
