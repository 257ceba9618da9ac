// Sees every call go by, whatever service it is for: counts it, logs it, traces it.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <memory>
#include <vector>

#include "server/metrics.h"
#include "server/trace.h"

namespace strata::server {

// For grpc::ServerBuilder::experimental().SetInterceptorCreators. The references must outlive the server.
std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> watch_calls(Metrics& metrics, Tracer& tracer);

}  // namespace strata::server
