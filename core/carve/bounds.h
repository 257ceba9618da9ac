// What a triangle of the surface is good for, once it is known which volumes are meshed.
#pragma once

#include <cstdint>

namespace strata {

enum class Bounds : std::uint8_t {
  Unknown,    // too small for any cell to meet it, as all of its neighbours
  Nothing,    // the same on both sides, or no meshed region on either
  Wall,       // one region
  Interface,  // two regions
};

}  // namespace strata
