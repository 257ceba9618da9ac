// What every gRPC server is expected to have: health of each service, reflection. By hand, because the messages are this small.
#include <grpcpp/generic/generic_stub.h>

#include <string>

#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

class StandardServices : public ServerFixture {
 protected:
  // A message with one string.
  static std::string message(int field, const std::string& text) {
    return std::string(1, static_cast<char>(field << 3 | 2)) + static_cast<char>(text.size()) + text;
  }

  std::string ask(const std::string& method, const std::string& request, grpc::Status& status) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
    grpc::GenericStub stub(channel_);
    grpc::CompletionQueue queue;
    const auto stream = stub.PrepareCall(&context, method, &queue);
    const auto step = [&] {
      void* tag = nullptr;
      bool ok = false;
      queue.Next(&tag, &ok);
      return ok;
    };
    stream->StartCall(nullptr);
    step();
    const grpc::Slice slice(request);
    stream->WriteLast(grpc::ByteBuffer(&slice, 1), {}, nullptr);
    step();
    grpc::ByteBuffer answer;
    stream->Read(&answer, nullptr);
    const bool answered = step();
    stream->Finish(&status, nullptr);
    step();
    grpc::Slice bytes;
    return answered && answer.DumpToSingleSlice(&bytes).ok() ? std::string(bytes.begin(), bytes.end()) : std::string();
  }

  std::string health_of(const std::string& service) {
    grpc::Status status;
    const std::string answer = ask("/grpc.health.v1.Health/Check", service.empty() ? "" : message(1, service), status);
    if (!status.ok()) return std::to_string(status.error_code());
    return answer == "\x08\x01" ? "serving" : answer == "\x08\x02" ? "not serving" : "unknown";
  }
};

TEST_F(StandardServices, HealthIsToldOfEachServiceAndOfTheWhole) {
  start();
  for (const char* service : {"", "strata.v1.JobService", "strata.v1.BlobService", "strata.v1.SystemService"})
    EXPECT_EQ(health_of(service), "serving") << service;
  EXPECT_EQ(health_of("strata.v1.NoSuchService"), std::to_string(grpc::StatusCode::NOT_FOUND));
  server_->set_not_serving();
  for (const char* service : {"", "strata.v1.JobService", "strata.v1.BlobService", "strata.v1.SystemService"})
    EXPECT_EQ(health_of(service), "not serving") << service;
}

TEST_F(StandardServices, ReflectionListsThem) {
  start();
  grpc::Status status;
  const std::string services = ask("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", message(7, "*"), status);
  for (const char* service : {"strata.v1.JobService", "strata.v1.BlobService", "strata.v1.SystemService", "grpc.health.v1.Health"})
    EXPECT_NE(services.find(service), std::string::npos) << service;
}

}  // namespace
}  // namespace strata::server
