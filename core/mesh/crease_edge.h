// What labels of quads do not show of the matched features.
#pragma once

#include <cstdint>

#include "core/base/ids.h"

namespace strata {

// An edge of the skin on the path of a crease: a feature curve with the same chart on both sides.
struct CreaseEdge {
  std::int32_t path = -1;  // which; edges of one path run through its vertices in one line
  VertexId a, b;
};

}  // namespace strata
