// Writing (and, for tests, reading back) hex meshes.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/base/ids.h"
#include "core/mesh/hex_mesh.h"

namespace strata::io {

enum class MeshFormat { MeditAscii, MeditBinary, Vtu, Vtk };  // .mesh, .meshb, .vtu (appended raw, zlib), .vtk (legacy binary)

std::optional<MeshFormat> mesh_format(std::string_view file_name);

// References in files: region id + 1 for hexes, patch id + 1 for quads. VTK formats: cell arrays `ref` and `layer`; quads are cells after the
// hexes, layer 0. Vertices are written in mesh order.
struct WriteOptions {
  int compression_level = 1;  // zlib, for .vtu
};
using ByteSink = std::function<void(std::span<const char>)>;
void write_mesh(const HexMesh& mesh, MeshFormat format, const WriteOptions& options, const ByteSink& sink);
void write_mesh_file(const HexMesh& mesh, const std::string& path, const WriteOptions& options = {});
// The `layer` solution file (.sol/.solb) that goes with a Medit mesh.
void write_layer_solution(const HexMesh& mesh, MeshFormat format, const ByteSink& sink);

}  // namespace strata::io
