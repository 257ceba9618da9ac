// One reader a format; `read_surface` chooses.
#pragma once

#include <span>

#include "core/surface/triangle_soup.h"

namespace strata::io {

TriangleSoup read_stl(std::span<const char> bytes);        // decides between the two below
TriangleSoup read_stl_ascii(std::span<const char> bytes);
TriangleSoup read_stl_binary(std::span<const char> bytes);
TriangleSoup read_obj(std::span<const char> bytes);
TriangleSoup read_off(std::span<const char> bytes);
TriangleSoup read_ply(std::span<const char> bytes);
TriangleSoup read_medit_ascii(std::span<const char> bytes);
TriangleSoup read_gmf(std::span<const char> bytes);        // Medit's binary form
bool looks_like_gmf(std::span<const char> bytes);

}  // namespace strata::io
