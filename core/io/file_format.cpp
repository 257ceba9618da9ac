#include "core/io/file_format.h"

#include <algorithm>

#include "core/io/mesh_io.h"
#include "core/io/surface_io.h"

namespace strata::io {

std::string lower_extension(std::string_view file_name) {
  const auto dot = file_name.find_last_of("./\\");
  if (dot == std::string_view::npos || file_name[dot] != '.') return {};
  std::string ending(file_name.substr(dot + 1));
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return ending;
}

std::optional<SurfaceFormat> surface_format(std::string_view file_name) {
  const std::string ending = lower_extension(file_name);
  if (ending == "stl") return SurfaceFormat::Stl;
  if (ending == "obj") return SurfaceFormat::Obj;
  if (ending == "off") return SurfaceFormat::Off;
  if (ending == "ply") return SurfaceFormat::Ply;
  if (ending == "mesh" || ending == "meshb") return SurfaceFormat::Medit;
  return std::nullopt;
}

std::optional<MeshFormat> mesh_format(std::string_view file_name) {
  const std::string ending = lower_extension(file_name);
  if (ending == "mesh") return MeshFormat::MeditAscii;
  if (ending == "meshb") return MeshFormat::MeditBinary;
  if (ending == "vtu") return MeshFormat::Vtu;
  if (ending == "vtk") return MeshFormat::Vtk;
  return std::nullopt;
}

}  // namespace strata::io
