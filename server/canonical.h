// A message as bytes that are the same each time it says the same.
#pragma once

#include <google/protobuf/message_lite.h>

#include <string>

namespace strata::server {

std::string canonical_bytes(const google::protobuf::MessageLite& message);

}  // namespace strata::server
