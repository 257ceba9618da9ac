// The gRPC services, each thin: decode, ask the desk or the store, encode.
#pragma once

#include <grpcpp/impl/codegen/server_context.h>
#include <grpcpp/impl/codegen/service_type.h>

#include <chrono>
#include <memory>

#include "server/blob_store.h"
#include "server/gate.h"
#include "server/job_desk.h"
#include "server/transfers.h"

namespace strata::server {

// Sizes of messages and blobs that the services accept.
struct WireLimits {
  std::int64_t max_message_bytes = (std::int64_t{4} << 20) + (std::int64_t{64} << 10);
  std::int64_t max_frame_bytes = std::int64_t{4} << 20;
  std::int64_t max_upload_bytes = std::int64_t{4} << 30;
};

// The references must outlive the services.
std::unique_ptr<grpc::Service> make_blob_service(Gate& gate, const JobDesk& desk, BlobStore& blobs, Transfers& transfers,
                                                 const WireLimits& limits);
std::unique_ptr<grpc::Service> make_job_service(Gate& gate, JobDesk& desk, BlobStore& blobs, Transfers& transfers,
                                                const WireLimits& limits);
std::unique_ptr<grpc::Service> make_system_service(Gate& gate, const JobDesk& desk, const WireLimits& limits);

// What the call shows of its caller.
Credentials credentials_of(const grpc::CallbackServerContext& context);

}  // namespace strata::server
