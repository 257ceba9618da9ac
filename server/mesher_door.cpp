#include "server/mesher_door.h"

#include "core/mesher.h"

namespace strata::server {

MesherDoor mesher_door() { return {&strata::generate, &strata::check_request, &strata::check}; }

}  // namespace strata::server
