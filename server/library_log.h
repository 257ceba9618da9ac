// What gRPC and protobuf have to say goes where everything goes: one JSON object a line.
#pragma once

namespace strata::server {

// For the whole process, from now on.
void take_library_logs();

}  // namespace strata::server
