// Legacy .vtk, binary: big-endian, 32-bit indices, cells as { size, vertices... }.
#include <algorithm>
#include <bit>
#include <limits>
#include <string>

#include "core/io/mesh_writers.h"
#include "core/io/read_error.h"
#include "core/io/vtk_cells.h"

namespace strata::io {
namespace {

template <class T>
void append_big_endian(std::string& out, T value) {
  append(out, value);
  if constexpr (std::endian::native == std::endian::little) std::reverse(out.end() - sizeof(T), out.end());
}

template <class Elements>
void write_cells(ByteStream& out, const Elements& elements) {
  write_parallel(out, elements.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t e = begin; e < end; ++e) {
      const auto& vertices = elements.values()[e];
      append_big_endian(text, static_cast<std::int32_t>(vertices.size()));
      for (const VertexId v : vertices) append_big_endian(text, v.value);
    }
  });
}

template <class ValueOf>
void write_cell_values(ByteStream& out, std::size_t count, const ValueOf& value_of) {
  write_parallel(out, count, [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t c = begin; c < end; ++c) append_big_endian<std::int32_t>(text, value_of(c));
  });
  out.write("\n");
}

}  // namespace

void write_vtk(const HexMesh& mesh, ByteStream& out) {
  const std::size_t hexes = mesh.hexes.size(), cells = hexes + mesh.quads.size();
  const std::size_t integers = 9 * hexes + 5 * mesh.quads.size();
  if (integers > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    refuse(Reason::FormatUnknown, {}, "legacy .vtk cannot hold " + std::to_string(cells) + " cells; use .vtu or .meshb",
           {{"cells", static_cast<double>(cells)}});
  out.write("# vtk DataFile Version 3.0\nStrata hexahedral mesh\nBINARY\nDATASET UNSTRUCTURED_GRID\n");
  out.write("POINTS " + std::to_string(mesh.position.size()) + " double\n");
  write_parallel(out, mesh.position.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t v = begin; v < end; ++v)
      for (const double x : mesh.position[VertexId(v)]) append_big_endian(text, x);
  });
  out.write("\nCELLS " + std::to_string(cells) + " " + std::to_string(integers) + "\n");
  write_cells(out, mesh.hexes);
  write_cells(out, mesh.quads);
  out.write("\nCELL_TYPES " + std::to_string(cells) + "\n");
  write_cell_values(out, cells, [&](std::size_t c) { return vtk_type(mesh, c); });
  out.write("CELL_DATA " + std::to_string(cells) + "\nSCALARS ref int 1\nLOOKUP_TABLE default\n");
  write_cell_values(out, cells, [&](std::size_t c) { return vtk_reference(mesh, c); });
  out.write("SCALARS layer int 1\nLOOKUP_TABLE default\n");
  write_cell_values(out, cells, [&](std::size_t c) { return vtk_layer(mesh, c); });
}

}  // namespace strata::io
