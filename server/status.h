// Where errors end: failures of core and refusals of the service as gRPC statuses with google.rpc details.
#pragma once

#include <grpcpp/support/status.h>

#include <new>
#include <string>

#include "core/base/diagnostic.h"
#include "server/job_error.h"
#include "server/refusal.h"
#include "strata/v1/job.pb.h"

namespace strata::server {

// Details stay within 4 KiB: beyond some 6 KB gRPC 1.51 replaces the error by another one.
inline constexpr std::size_t kMaxDetailBytes = 4096;

grpc::Status to_status(const MeshError& error);
grpc::Status to_status(const Refusal& refusal);
grpc::Status to_status(const v1::JobError& error);

// ErrorInfo.reason in the details; empty: there is none.
std::string reason_in(const std::string& error_details);

// The status of running `body`.
template <class Body>
grpc::Status status_of(const Body& body) {
  try {
    body();
    return grpc::Status::OK;
  } catch (const MeshError& error) {
    return to_status(error);
  } catch (const Refusal& refusal) {
    return to_status(refusal);
  } catch (const JobRefused& refused) {
    return to_status(refused.error);
  } catch (const std::bad_alloc&) {
    return to_status(Refusal(Refused::ResourceExhausted, "OUT_OF_MEMORY", "the server is short of memory").retry_after(10));
  } catch (const std::exception& error) {
    return {grpc::StatusCode::INTERNAL, error.what()};
  }
}

}  // namespace strata::server
