// The specification file: JSON goes to the server as it is, YAML as the JSON it stands for.
#pragma once

#include <string>

namespace strata::client {

// Throws CommandError(Usage) when it cannot be read, CommandError(InputRejected) when it is no YAML.
std::string spec_json_of(const std::string& path);

}  // namespace strata::client
