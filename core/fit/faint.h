// Which curves a mesh may do without. Private to the room.
#pragma once

#include <cmath>
#include <numbers>

#include "core/features/features.h"

namespace strata {

// A crease that turns by less is often noise of the triangulation.
inline constexpr double kFaint = std::numbers::pi / 3;

inline bool turns_little(const Curve& curve) { return std::abs(std::numbers::pi - curve.dihedral_mean) < kFaint; }

// Patches are kept: their borders are not for us.
inline bool is_inside_patch(const Features& features, const Curve& curve) {
  return curve.manifold && curve.left.valid() && curve.right.valid() &&
         features.patch_of_chart[curve.left] == features.patch_of_chart[curve.right];
}

}  // namespace strata
