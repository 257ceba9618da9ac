// Morton codes: the bits of x, y and z interleaved, x lowest. A node of level l has coordinates 0 .. 2^l - 1, so its parent
// is code >> 3 and its children are code << 3 | 0..7.
#pragma once

#include <array>
#include <cstdint>

namespace strata {

using GridPoint = std::array<std::int64_t, 3>;

// Spreads the low 21 bits three apart, and back.
constexpr std::uint64_t spread_bits(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x001f00000000ffff;
  v = (v | v << 16) & 0x001f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  v = (v | v << 2) & 0x1249249249249249;
  return v;
}
constexpr std::uint64_t gather_bits(std::uint64_t v) {
  v &= 0x1249249249249249;
  v = (v | v >> 2) & 0x10c30c30c30c30c3;
  v = (v | v >> 4) & 0x100f00f00f00f00f;
  v = (v | v >> 8) & 0x001f0000ff0000ff;
  v = (v | v >> 16) & 0x001f00000000ffff;
  v = (v | v >> 32) & 0x1fffff;
  return v;
}

constexpr std::uint64_t morton_code(const GridPoint& p) {
  return spread_bits(static_cast<std::uint64_t>(p[0])) | spread_bits(static_cast<std::uint64_t>(p[1])) << 1 |
         spread_bits(static_cast<std::uint64_t>(p[2])) << 2;
}
constexpr GridPoint morton_point(std::uint64_t code) {
  return {static_cast<std::int64_t>(gather_bits(code)), static_cast<std::int64_t>(gather_bits(code >> 1)),
          static_cast<std::int64_t>(gather_bits(code >> 2))};
}

}  // namespace strata
