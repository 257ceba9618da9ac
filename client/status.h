// From a failed call to a message for people and an exit status for scripts.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "client/exit_code.h"
#include "strata/v1/diagnostic.pb.h"
#include "strata/v1/job.pb.h"

namespace grpc {
class Status;
}

namespace strata::client {

// `doing` completes "while ...": "uploading rocket.stl".
CommandError command_error(const grpc::Status& status, const std::string& doing);
// Of a job that ended without a mesh.
CommandError command_error(const v1::Job& job);
// "LAYERS_THINNED on patch wing: ...", with place and triangles where known.
std::string describe(const v1::Diagnostic& diagnostic);
// On one line; bytes that are no UTF-8 are replaced.
std::string safe_dump(const nlohmann::json& json);
// Without control characters.
std::string printable(std::string text);
// Worth trying again after a while.
bool transient(const grpc::Status& status);

}  // namespace strata::client
