// The service says no: what a call cannot have, before any meshing. status.cpp turns it into a gRPC status.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace strata::server {

enum class Refused {
  InvalidArgument,
  NotFound,
  AlreadyExists,
  FailedPrecondition,
  ResourceExhausted,
  Unavailable,
  OutOfRange,
  DataLoss,
  Unauthenticated,
  PermissionDenied,
  Unimplemented,
};

class Refusal : public std::runtime_error {
 public:
  Refusal(Refused why, std::string machine_reason, const std::string& message)
      : std::runtime_error(message), kind(why), reason(std::move(machine_reason)) {}

  // The path of the field that is wrong, such as "surface.blob_id".
  Refusal& at(std::string path) {
    field = std::move(path);
    return *this;
  }
  // When it makes sense to ask again.
  Refusal& retry_after(double seconds) {
    retry_seconds = seconds;
    return *this;
  }

  Refused kind;
  std::string reason;  // UPPER_SNAKE
  std::string field;
  double retry_seconds = 0;  // 0: do not retry
};

}  // namespace strata::server
