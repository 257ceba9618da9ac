// What one client may take of the server: bytes, metadata, streams, connections.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <thread>
#include <vector>

#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;

class Limits : public ServerFixture {
 protected:
  grpc::Status create_with(grpc::ClientContext& context, const v1::CreateJobRequest& request) {
    context.set_deadline(std::chrono::system_clock::now() + 20s);
    v1::CreateJobResponse response;
    return job_stub_->CreateJob(&context, request, &response);
  }

  testing::AssertionResult answers(const std::shared_ptr<grpc::Channel>& channel) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + 10s);
    v1::GetServerStatusResponse response;
    const grpc::Status status = v1::SystemService::NewStub(channel)->GetServerStatus(&context, {}, &response);
    if (status.ok()) return testing::AssertionSuccess();
    return testing::AssertionFailure() << status.error_code() << ": " << status.error_message();
  }

  // A connection of its own.
  std::shared_ptr<grpc::Channel> new_channel() {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return grpc::CreateCustomChannel(server_->addresses().back(), grpc::InsecureChannelCredentials(), arguments);
  }

  // A connection that says nothing.
  int mute_connection() {
    const std::string address = server_->addresses().back();
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
    inet_pton(AF_INET, "127.0.0.1", &at.sin_addr);
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    EXPECT_EQ(connect(fd, reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
    return fd;
  }
};

TEST_F(Limits, AMessageThatIsTooLargeIsRefused) {
  start();
  v1::CreateJobRequest request = tetrahedron_job();
  request.set_spec_json(std::string(5 << 20, ' '));
  grpc::ClientContext context;
  EXPECT_EQ(create_with(context, request).error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_TRUE(answers(channel_));
}

TEST_F(Limits, AMessageThatWouldUnpackToMuchMoreIsNotUnpacked) {
  start();
  v1::CreateJobRequest request = tetrahedron_job();
  request.set_spec_json(std::string(64 << 20, ' '));
  for (const grpc_compression_algorithm packed : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
    grpc::ClientContext context;
    context.set_compression_algorithm(packed);
    EXPECT_EQ(create_with(context, request).error_code(), StatusCode::UNIMPLEMENTED);
  }
  EXPECT_TRUE(answers(channel_));
}

// gRPC ends the connection that sent it soon after the refusal; the client opens another one, and connections beside it stay.
TEST_F(Limits, MetadataThatIsTooLargeIsRefused) {
  start();
  const auto beside = new_channel();
  ASSERT_TRUE(answers(beside));
  grpc::ClientContext context;
  context.AddMetadata("x-request-id", std::string(64 << 10, 'x'));
  EXPECT_EQ(create_with(context, tetrahedron_job()).error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(beside->GetState(false), GRPC_CHANNEL_READY);
  EXPECT_TRUE(answers(beside));
  const auto deadline = std::chrono::steady_clock::now() + 10s;
  while (!answers(channel_) && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(10ms);
  EXPECT_TRUE(answers(channel_));
}

TEST_F(Limits, StreamsBeyondTheLimitOfAConnectionWaitAndOthersGoOn) {
  start();
  mesher_.hold();
  const std::string id = create(tetrahedron_job()).job_id();
  v1::WatchJobRequest request;
  request.set_job_id(id);
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::WatchJobResponse>>> watches;
  for (int i = 0; i < 256; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    watches.push_back(job_stub_->WatchJob(contexts.back().get(), request));
    v1::WatchJobResponse first;
    ASSERT_TRUE(watches.back()->Read(&first)) << i;
  }
  grpc::ClientContext late;
  late.set_deadline(std::chrono::system_clock::now() + 300ms);
  v1::GetJobRequest get_request;
  get_request.set_job_id(id);
  v1::GetJobResponse got;
  EXPECT_EQ(job_stub_->GetJob(&late, get_request, &got).error_code(), StatusCode::DEADLINE_EXCEEDED);
  EXPECT_TRUE(answers(new_channel()));
  for (const auto& context : contexts) context->TryCancel();
  for (const auto& watch : watches) watch->Finish();
  EXPECT_TRUE(answers(channel_));
}

TEST_F(Limits, ConnectionsBeyondTheLimitAreClosedAndTheRestIsServed) {
  TestOptions options;
  options.listen = "127.0.0.1:0";
  options.max_connections = 8;
  start(options);
  const auto first = new_channel();
  ASSERT_TRUE(answers(first));
  std::vector<int> flood;
  for (int i = 0; i < 100; ++i) flood.push_back(mute_connection());
  int closed = 0;
  for (const int fd : flood) {
    timeval soon{1, 0};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &soon, sizeof soon);
    if (closed + 7 < 100) {
      char byte = 0;
      // gRPC greets the ones that it was given with its settings, the others hear nothing but the end.
      if (recv(fd, &byte, 1, 0) == 0) ++closed;
    }
  }
  EXPECT_EQ(closed, 100 - 7);
  EXPECT_TRUE(answers(first));
  for (const int fd : flood) close(fd);
  bool again = false;
  for (int i = 0; i < 100 && !again; ++i, std::this_thread::sleep_for(50ms)) again = answers(new_channel());
  EXPECT_TRUE(again);
}

}  // namespace
}  // namespace strata::server
