// The cells of VTK files: the hexes, then the quads.
#pragma once

#include "core/io/mesh_writers.h"

namespace strata::io {

inline constexpr std::int32_t kVtkQuad = 9;
inline constexpr std::int32_t kVtkHexahedron = 12;

inline std::int32_t vtk_type(const HexMesh& mesh, std::size_t cell) { return cell < mesh.hexes.size() ? kVtkHexahedron : kVtkQuad; }
inline std::int32_t vtk_reference(const HexMesh& mesh, std::size_t cell) {
  return cell < mesh.hexes.size() ? reference_of_hex(mesh, cell) : reference_of_quad(mesh, cell - mesh.hexes.size());
}
inline std::int32_t vtk_layer(const HexMesh& mesh, std::size_t cell) { return cell < mesh.hexes.size() ? layer_of_hex(mesh, cell) : 0; }

}  // namespace strata::io
