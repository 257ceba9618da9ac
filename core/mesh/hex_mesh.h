// The one mesh that travels down the pipeline: plain arrays, moved from stage to stage.
#pragma once

#include <array>
#include <cstdint>

#include "core/base/ids.h"
#include "core/base/vec3.h"

namespace strata {

using HexVertices = std::array<VertexId, 8>;   // numbering of mesh/hex.h
using QuadVertices = std::array<VertexId, 4>;

// Where on the input geometry a vertex must stay. Order is the priority: more constrained is larger.
enum class Hold : std::uint8_t {
  Free,    // inside the volume
  Chart,   // slides on the chart `of` (2 degrees of freedom)
  Curve,   // slides on the curve `of` (1 degree of freedom)
  Corner,  // stays on the corner `of`
  Fixed,   // does not move at all (`of` unused)
};
// `of` of a Hold::Chart vertex that may slide over the whole surface, whatever chart (features not matched, or softened there).
inline constexpr std::int32_t kWholeSurface = -1;
struct Attachment {
  Hold hold = Hold::Free;
  std::int32_t of = -1;  // ChartId, CurveId or CornerId value, by hold
  friend bool operator==(const Attachment&, const Attachment&) = default;
};

// Invariants after wrap_surface: every hex has at most one quad; every boundary quad's normal (right-hand rule) points out of
// the meshed volume; an interface quad is stored once and points out of the region with the smaller id.
struct HexMesh {
  IdMap<VertexId, Vec3> position;
  IdMap<VertexId, Attachment> attachment;  // sized like position

  IdMap<HexId, HexVertices> hexes;
  IdMap<HexId, RegionId> region;           // sized like hexes
  IdMap<HexId, std::uint16_t> layer;       // sized like hexes: 0 in the volume, 1..n in boundary layers, counted from the wall

  IdMap<QuadId, QuadVertices> quads;       // boundary and interface quads; empty before carve
  IdMap<QuadId, PatchId> patch;            // sized like quads: reference of the quad
  IdMap<QuadId, ChartId> chart;            // sized like quads: piece of the patch it is fitted to; invalid before labelling
};

inline std::array<Vec3, 8> corners_of(const HexMesh& mesh, HexId h) {
  std::array<Vec3, 8> corners;
  for (std::size_t i = 0; i < 8; ++i) corners[i] = mesh.position[mesh.hexes[h][i]];
  return corners;
}

}  // namespace strata
