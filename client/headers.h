// What every call carries besides its message: who calls, and a name for the command under which servers log it.
#pragma once

#include <grpcpp/support/client_interceptor.h>

#include <memory>
#include <string>
#include <vector>

namespace strata::client {

// For grpc::experimental::CreateCustomChannelWithInterceptors. `token` may be empty.
std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> add_headers(const std::string& token);

}  // namespace strata::client
