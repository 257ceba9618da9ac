// Reading surfaces. Formats: STL (ASCII with several named solids, binary), OBJ (g, else o, else usemtl), OFF, PLY (ascii, binary both
// endians; face property patch, ref or label), Medit .mesh and GMF .meshb (references).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/surface/triangle_soup.h"

namespace strata::io {

enum class SurfaceFormat { Stl, Obj, Off, Ply, Medit };  // Medit: .mesh and .meshb

// "wing.STL" -> Stl. Empty when the ending is unknown.
std::optional<SurfaceFormat> surface_format(std::string_view file_name);

// Parses a whole file in memory. Bounded memory whatever the counts in headers say. Throws MeshError(InvalidInput) naming line or byte
// and what was expected: FileMalformed, SurfaceEmpty, SurfaceNonFinite, SurfaceIndexOutOfRange.
TriangleSoup read_surface(std::span<const char> bytes, SurfaceFormat format);
// Reads the file; `name` of errors is the file's base name.
TriangleSoup read_surface_file(const std::string& path);

}  // namespace strata::io
