// Shell completion scripts, generated from the command table.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace strata::client {

// `shell` is bash, zsh or fish.
std::string completion(const CLI::App& app, const std::string& shell);

}  // namespace strata::client
