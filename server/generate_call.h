// JobService.GenerateMesh: surface up, events and artifacts down, in one call.
#pragma once

#include "server/services.h"
#include "server/task_pool.h"
#include "strata/v1/job.grpc.pb.h"

namespace strata::server {

// The call owns itself. The references must outlive it.
grpc::ServerBidiReactor<v1::GenerateMeshRequest, v1::GenerateMeshResponse>* begin_generate(Gate& gate, grpc::CallbackServerContext& context,
                                                                                           JobDesk& desk, BlobStore& blobs,
                                                                                           Transfers& transfers, TaskPool& pool,
                                                                                           const WireLimits& limits);

}  // namespace strata::server
