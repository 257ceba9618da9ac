// server status, server health, version: the server itself.
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <cstdio>
#include <iostream>

#include "client/call.h"
#include "client/commands.h"
#include "client/connection.h"
#include "client/job_calls.h"
#include "client/version.h"

namespace strata::client {
namespace {

constexpr auto kHealthLimit = std::chrono::seconds(5);

}  // namespace

void server_status(const GlobalOptions& global) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  const auto method = [&](auto* context, const auto& r, auto* response) {
    return connection.system->GetServerStatus(context, r, response);
  };
  const auto status = call<v1::GetServerStatusRequest, v1::GetServerStatusResponse>(method, {}, global, "asking the server");
  if (global.output == Output::Json) {
    std::cout << as_json(status) << '\n';
    return;
  }
  std::printf("server     %s%s\nrunning    %d\nqueued     %d\njobs       %lld\nmemory     %.0f MB\n", connection.address.c_str(),
              status.draining() ? " (draining)" : "", status.running_jobs(), status.queued_jobs(),
              static_cast<long long>(status.jobs_total()), 1e-6 * static_cast<double>(status.resident_memory_bytes()));
}

// Asks the standard health service, which answers without credentials; by hand, because its messages are this small.
void server_health(const GlobalOptions& global) {
  Connection connection = connect(global, PrivateServerAllowed::No);
  grpc::ClientContext context;
  set_deadline(context, kHealthLimit);
  CallGuard guard(context, kHealthLimit);
  grpc::CompletionQueue queue;
  const grpc::ByteBuffer question(nullptr, 0);
  grpc::ByteBuffer answer;
  grpc::Status status;
  const auto call = grpc::GenericStub(connection.channel).PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", question, &queue);
  call->StartCall();
  call->Finish(&answer, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  if (!status.ok()) throw command_error(status, "asking for the health of the server");
  grpc::Slice bytes;
  const std::string serving = "\x08\x01";  // HealthCheckResponse{status: SERVING}
  const bool healthy = answer.DumpToSingleSlice(&bytes).ok() && std::string(bytes.begin(), bytes.end()) == serving;
  if (!healthy) throw CommandError(ExitCode::Unreachable, "the server at " + connection.address + " is not serving");
  std::cout << "serving" << std::endl;
}

void version(const GlobalOptions& global, bool of_server) {
  std::cout << "strata " << kVersion << std::endl;
  if (!of_server) return;
  Connection connection = connect(global, PrivateServerAllowed::Yes);
  const auto method = [&](auto* context, const auto& r, auto* response) {
    return connection.system->GetCapabilities(context, r, response);
  };
  std::cout << "stratad "
            << call<v1::GetCapabilitiesRequest, v1::GetCapabilitiesResponse>(method, {}, global, "asking the server").version() << '\n';
}

}  // namespace strata::client
