// Medit .mesh and .sol. Coordinates are the shortest text that reads back as the same double.
#include <charconv>
#include <string>

#include "core/io/mesh_writers.h"

namespace strata::io {
namespace {

template <class T>
void append_number(std::string& out, T value) {
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof(text), value);
  out.append(text, end);
}

template <class Vertices>
void append_element(std::string& out, const Vertices& vertices, std::int32_t reference) {
  for (const VertexId v : vertices) {
    append_number(out, v.value + 1);
    out += ' ';
  }
  append_number(out, reference);
  out += '\n';
}

void begin_section(ByteStream& out, const char* keyword, std::size_t count) {
  out.write("\n" + std::string(keyword) + "\n" + std::to_string(count) + "\n");
}

void write_vertices(const HexMesh& mesh, ByteStream& out) {
  begin_section(out, "Vertices", mesh.position.size());
  write_parallel(out, mesh.position.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t v = begin; v < end; ++v) {
      for (const double x : mesh.position[VertexId(v)]) {
        append_number(text, x);
        text += ' ';
      }
      text += "0\n";
    }
  });
}

void write_hexes(const HexMesh& mesh, ByteStream& out) {
  begin_section(out, "Hexahedra", mesh.hexes.size());
  write_parallel(out, mesh.hexes.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t h = begin; h < end; ++h) append_element(text, mesh.hexes[HexId(h)], reference_of_hex(mesh, h));
  });
}

void write_quads(const HexMesh& mesh, ByteStream& out) {
  if (mesh.quads.empty()) return;
  begin_section(out, "Quadrilaterals", mesh.quads.size());
  write_parallel(out, mesh.quads.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t q = begin; q < end; ++q) append_element(text, mesh.quads[QuadId(q)], reference_of_quad(mesh, q));
  });
}

constexpr std::string_view kHeader = "MeshVersionFormatted 2\n\nDimension 3\n";
constexpr std::string_view kEnd = "\nEnd\n";

}  // namespace

void write_medit_ascii(const HexMesh& mesh, ByteStream& out) {
  out.write(kHeader);
  write_vertices(mesh, out);
  write_quads(mesh, out);
  write_hexes(mesh, out);
  out.write(kEnd);
}

void write_medit_layers(const HexMesh& mesh, ByteStream& out) {
  out.write(kHeader);
  begin_section(out, "SolAtHexahedra", mesh.hexes.size());
  out.write("1 1\n");  // one field, a scalar
  write_parallel(out, mesh.hexes.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t h = begin; h < end; ++h) {
      append_number(text, layer_of_hex(mesh, h));
      text += '\n';
    }
  });
  out.write(kEnd);
}

}  // namespace strata::io
