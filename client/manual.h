// The manual page, generated from the command table.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace strata::client {

// For man(7): strata manual | man -l -
std::string manual(const CLI::App& app);

}  // namespace strata::client
