// Names of jobs, uploads and blobs.
#pragma once

#include <string>
#include <string_view>

namespace strata::server {

// 128 random bits from the system as 26 characters of a-z and 0-9: unguessable, safe in a path and in a URL.
std::string random_id();

// Has it the form of an id? Whatever has not is nobody's name; only ids that pass ever meet the file system.
bool is_id(std::string_view text);

}  // namespace strata::server
