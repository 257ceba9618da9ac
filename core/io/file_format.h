// File endings, compared without regard to case.
#pragma once

#include <string>
#include <string_view>

namespace strata::io {

// "dir/wing.STL" -> "stl"; empty when the name has no ending.
std::string lower_extension(std::string_view file_name);

}  // namespace strata::io
