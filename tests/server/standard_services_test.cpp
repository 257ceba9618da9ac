// What every gRPC server is expected to have: health of each service, reflection. By hand, because the messages are this small.
#include <grpcpp/generic/generic_stub.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "server/ids.h"
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

// A caller who says nothing of traces: the call and what comes of it are one trace all the same.
TEST_F(StandardServices, AJobIsFoundByTheTraceOfItsCall) {
  TestOptions options;
  options.trace_file = (std::filesystem::temp_directory_path() / ("strata-spans-" + random_id())).string();
  start(options);
  EXPECT_EQ(wait_final(create(tetrahedron_job()).job_id()).state(), v1::JOB_STATE_SUCCEEDED);
  TearDown();
  std::map<std::string, nlohmann::json> spans;
  std::ifstream file(options.trace_file);
  for (std::string line; std::getline(file, line);) {
    const auto span = nlohmann::json::parse(line)["resourceSpans"][0]["scopeSpans"][0]["spans"][0];
    spans[span["name"]] = span;
  }
  const nlohmann::json &call = spans["JobService/CreateJob"], &job = spans["job"];
  EXPECT_EQ(job["traceId"], call["traceId"]);
  EXPECT_EQ(job["parentSpanId"], call["spanId"]);
  EXPECT_FALSE(call.contains("parentSpanId"));
  std::filesystem::remove(options.trace_file);
}

}  // namespace
}  // namespace strata::server
