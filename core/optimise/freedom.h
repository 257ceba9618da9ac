// Which way a vertex may go. Private to the room.
#pragma once

#include "core/base/vec3.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// Directions a vertex may take: as columns of a basis, `dimensions` of them.
struct Freedom {
  Mat3 basis = Mat3::Identity();
  int dimensions = 3;
};
// `direction`: of a chart its normal, of a curve its tangent. Nowhere where it is zero.
Freedom freedom_of(Hold hold, const Vec3& direction);

}  // namespace strata
