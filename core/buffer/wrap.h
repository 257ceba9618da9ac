// Buffer layers: the mother layer under the whole surface, then ridge layers where charts meet.
#pragma once

#include <vector>

#include "core/features/features.h"
#include "core/mesh/crease_edge.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

class Context;

// Wraps every region in one layer of hexes, so that every hex has at most one quad. Outer vertices are moved a little outwards so that the
// layer has thickness where that keeps hexes positive; hexes may have zero thickness where not (the fit untangles). Interfaces get a
// layer on either side.
HexMesh wrap_surface(HexMesh mesh, Context& context);

// First gives creases whose path bends rows of hexes along the path; then inserts, chart by chart, a layer of hexes round the hexes that sit on the chart (S = hexes with a quad on it), so that on both sides of
// every ridge each quad has one edge on the ridge at most, whatever the dihedral angle (paper section 3, property 2). Charts whose borders
// and whose neighbours' borders already satisfy it are left alone. `mesh` must be labelled (chart on every quad). A chart where the
// insertion would pinch is skipped and reported. Ridge attachments (Curve, Corner) go with the vertices that stay on the ridge.
HexMesh wrap_ridges(HexMesh mesh, const Features& features, const std::vector<CreaseEdge>& creases, Context& context);

}  // namespace strata
