#include "core/io/surface_io.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include "core/io/read_error.h"
#include "core/io/surface_readers.h"

namespace strata::io {
namespace {

std::vector<char> read_bytes(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) refuse(Reason::FileMalformed, {}, "cannot be read: it is a directory");
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) refuse(Reason::FileMalformed, {}, std::string("cannot be read: ") + std::strerror(errno));
  const std::streamoff size = in.tellg();
  if (size < 0) refuse(Reason::FileMalformed, {}, "cannot be read: it has no size");
  std::vector<char> bytes(static_cast<std::size_t>(size));
  in.seekg(0);
  if (size > 0 && !in.read(bytes.data(), size)) refuse(Reason::FileMalformed, {}, "cannot be read to its end");
  return bytes;
}

}  // namespace

TriangleSoup read_surface(std::span<const char> bytes, SurfaceFormat format) {
  if (bytes.empty()) refuse(Reason::SurfaceEmpty, {}, "the file is empty");
  switch (format) {
    case SurfaceFormat::Stl: return read_stl(bytes);
    case SurfaceFormat::Obj: return read_obj(bytes);
    case SurfaceFormat::Off: return read_off(bytes);
    case SurfaceFormat::Ply: return read_ply(bytes);
    case SurfaceFormat::Medit: return looks_like_gmf(bytes) ? read_gmf(bytes) : read_medit_ascii(bytes);
  }
  refuse(Reason::FormatUnknown, {}, "the surface format is unknown");
}

TriangleSoup read_surface_file(const std::string& path) {
  const std::string name = std::filesystem::path(path).filename().string();
  try {
    const auto format = surface_format(name);
    if (!format) refuse(Reason::FormatUnknown, {}, "the ending is unknown; surfaces are .stl, .obj, .off, .ply, .mesh or .meshb");
    return read_surface(read_bytes(path), *format);
  } catch (const MeshError& error) {
    Diagnostic diagnostic = error.diagnostic();
    diagnostic.message = name + ": " + diagnostic.message;
    throw MeshError(error.failure(), std::move(diagnostic));
  }
}

}  // namespace strata::io
