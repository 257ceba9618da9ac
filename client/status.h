// From a failed call to a message for people and an exit status for scripts.
#pragma once

#include <string>

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
// Worth trying again after a while.
bool transient(const grpc::Status& status);

}  // namespace strata::client
