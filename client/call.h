// Calls of unary methods, again while the server is away.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <string>

#include "client/exit_code.h"
#include "client/interrupt.h"
#include "client/options.h"
#include "client/status.h"

namespace strata::client {

inline constexpr auto kCallLimit = std::chrono::seconds(30);

inline void set_deadline(grpc::ClientContext& context, std::chrono::seconds limit = kCallLimit) {
  context.set_deadline(std::chrono::system_clock::now() + limit);
}

// Calls a unary method, again while the server is away.
template <class Request, class Response, class Method>
Response call(const Method& method, const Request& request, const GlobalOptions& global, const std::string& doing,
              std::chrono::seconds limit = kCallLimit) {
  Backoff backoff(global.retries);
  for (;;) {
    grpc::ClientContext context;
    set_deadline(context, limit);
    CallGuard guard(context, limit);
    Response response;
    const grpc::Status status = method(&context, request, &response);
    if (status.ok()) return response;
    go_on();
    if (!transient(status) || !backoff.pause()) throw command_error(status, doing);
  }
}

}  // namespace strata::client
