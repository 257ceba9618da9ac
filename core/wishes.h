// What the specification says, as the stages understand it.
#pragma once

#include "core/features/features.h"
#include "core/octree/octree.h"
#include "core/sizing/size_field.h"
#include "core/spec/mesh_spec.h"
#include "core/surface/surface.h"

namespace strata {

// The specification with its lengths and places in the working frame.
MeshSpec in_working_frame(MeshSpec spec, const Frame& frame);

// Of a specification in the working frame.
SizeOptions size_options(const MeshSpec& spec, const Surface& surface, const Features& features);
OctreeOptions octree_options(const MeshSpec& spec);
FeatureOptions feature_options(const MeshSpec& spec);

}  // namespace strata
