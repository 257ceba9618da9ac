#include "core/io/mesh_io.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "core/io/mesh_writers.h"
#include "core/io/read_error.h"

namespace strata::io {
namespace {

[[noreturn]] void fail_writing(const std::string& path) {
  throw std::system_error(errno != 0 ? errno : EIO, std::generic_category(), path + " cannot be written");
}

}  // namespace

void write_mesh(const HexMesh& mesh, MeshFormat format, const WriteOptions& options, const ByteSink& sink) {
  ByteStream out(sink);
  switch (format) {
    case MeshFormat::MeditAscii: write_medit_ascii(mesh, out); break;
    case MeshFormat::MeditBinary: write_gmf(mesh, out); break;
    case MeshFormat::Vtu: write_vtu(mesh, options, out); break;
    case MeshFormat::Vtk: write_vtk(mesh, out); break;
  }
  out.finish();
}

void write_mesh_file(const HexMesh& mesh, const std::string& path, const WriteOptions& options) {
  const auto format = mesh_format(path);
  if (!format) refuse(Reason::FormatUnknown, {}, shown(path) + " has an unknown ending; meshes are .mesh, .meshb, .vtu or .vtk");
  const std::string unfinished = path + ".part";
  try {
    std::ofstream file(unfinished, std::ios::binary | std::ios::trunc);
    if (!file) fail_writing(unfinished);
    write_mesh(mesh, *format, options, [&](std::span<const char> bytes) {
      if (!file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()))) fail_writing(unfinished);
    });
    file.close();
    if (!file) fail_writing(unfinished);
    std::filesystem::rename(unfinished, path);
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove(unfinished, ignored);
    throw;
  }
}

void write_layer_solution(const HexMesh& mesh, MeshFormat format, const ByteSink& sink) {
  ByteStream out(sink);
  switch (format) {
    case MeshFormat::MeditAscii: write_medit_layers(mesh, out); break;
    case MeshFormat::MeditBinary: write_gmf_layers(mesh, out); break;
    case MeshFormat::Vtu:
    case MeshFormat::Vtk:
      refuse(Reason::FormatUnknown, {}, "VTK files hold the layers themselves; a solution file goes with Medit meshes only");
  }
  out.finish();
}

}  // namespace strata::io
