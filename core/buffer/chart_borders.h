// Where charts meet on the skin: which quads have too many border edges, and which chart's layer would cure them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/features/features.h"
#include "core/mesh/adjacency.h"
#include "core/mesh/hex_mesh.h"

namespace strata {

// Charts across each edge of each quad; the quad's own chart where the edge is no border.
struct ChartBorders {
  IdMap<QuadId, std::array<ChartId, 4>> across;
  IdMap<ChartId, std::uint8_t> tangled;  // 1: a border edge has more than two quads, or a corner more than three charts
};
ChartBorders chart_borders(const HexMesh& mesh, std::size_t chart_count);

// A pair of border edges of one quad that must not be: opposite ones, neighbours that meet at a vertex that is no corner, or at a corner
// where the chart's angle is too wide for one quad.
struct BorderConflict {
  QuadId quad;
  ChartId own;
  ChartId first, second;  // across the two edges
  bool wide_corner = false;
};
std::vector<BorderConflict> border_conflicts(const HexMesh& mesh, const ChartBorders& borders, const Features& features);

}  // namespace strata
