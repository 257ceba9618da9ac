// One writer a format; `write_mesh` chooses. What files say of an element is said here once.
#pragma once

#include "core/io/byte_stream.h"
#include "core/io/mesh_io.h"

namespace strata::io {

void write_medit_ascii(const HexMesh& mesh, ByteStream& out);
void write_gmf(const HexMesh& mesh, ByteStream& out);
void write_vtu(const HexMesh& mesh, const WriteOptions& options, ByteStream& out);
void write_vtk(const HexMesh& mesh, ByteStream& out);
void write_medit_layers(const HexMesh& mesh, ByteStream& out);
void write_gmf_layers(const HexMesh& mesh, ByteStream& out);

// References count from 1; 0 stands for "none yet" in meshes written before they are labelled.
inline std::int32_t reference_of_hex(const HexMesh& mesh, std::size_t h) {
  return h < mesh.region.size() ? mesh.region[HexId(h)].value + 1 : 0;
}
inline std::int32_t reference_of_quad(const HexMesh& mesh, std::size_t q) {
  return q < mesh.patch.size() ? mesh.patch[QuadId(q)].value + 1 : 0;
}
inline std::int32_t layer_of_hex(const HexMesh& mesh, std::size_t h) { return h < mesh.layer.size() ? mesh.layer[HexId(h)] : 0; }

}  // namespace strata::io
