// What is kept has to outlive.
#pragma once

namespace strata::server {

enum class Durability {
  PowerLoss,  // the disk is waited for before anything counts as stored
  Process,    // of the server only: nobody comes back for it after the machine went down
};

}  // namespace strata::server
