// The tables of the job store, and how older ones become them.
#pragma once

#include <string>

#include "server/sqlite.h"

namespace strata::server {

// Throws std::runtime_error when the store was written by a newer version; Refusal when it cannot be changed.
void migrate(const Database& database, const std::string& path);

}  // namespace strata::server
