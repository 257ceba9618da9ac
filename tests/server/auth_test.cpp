// Every call is behind the gate, and other tenants' things do not exist for a caller.
#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "server/ids.h"
#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

using namespace std::chrono_literals;

// Digests of the keys "key of ann", "key of bob", "key of vic" and "key of root".
constexpr const char* kKeys = R"(
keys:
  - {name: ann, sha256: db967788df725d2e43640856ada333767c775916b0fbd83fb04773ee5bf72457, tenant: a, role: submitter}
  - {name: bob, sha256: e737386ba7d8efdb2a513c0c194afcee56ab5f7f17ede91ff14b6e3053ad2127, tenant: b, role: submitter}
  - {name: vic, sha256: 17883a478536b32ec288f918f0f07d88972dec06b779126ff9f13385ca09e923, tenant: a, role: viewer}
  - {name: root, sha256: 535a198c9f40ac6c86e6f83aa8ba7bbb45198526091d1ed9ef3cca0472e56155, tenant: ops, role: admin}
tenants:
  b: {queued: 1, bytes: 100000}
)";

class Auth : public ServerFixture {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() / ("strata-auth-" + random_id())).string();
    std::ofstream(path_) << kKeys;
    TestOptions options;
    options.auth_file = path_;
    start(options);
  }
  void TearDown() override {
    ServerFixture::TearDown();
    std::filesystem::remove(path_);
  }

  // The status of any unary or streaming call with an empty request.
  grpc::Status call(const google::protobuf::MethodDescriptor& method, const std::string& key) {
    grpc::ClientContext context;
    if (!key.empty()) context.AddMetadata("authorization", "Bearer " + key);
    context.set_deadline(std::chrono::system_clock::now() + 10s);
    grpc::GenericStub stub(channel_);
    grpc::CompletionQueue queue;
    const auto stream = stub.PrepareCall(&context, "/" + method.service()->full_name() + "/" + method.name(), &queue);
    const auto step = [&] {
      void* tag = nullptr;
      bool ok = false;
      queue.Next(&tag, &ok);
      return ok;
    };
    stream->StartCall(nullptr);
    step();
    const grpc::ByteBuffer empty(nullptr, 0);
    stream->WriteLast(empty, {}, nullptr);
    step();
    grpc::ByteBuffer answer;
    do stream->Read(&answer, nullptr);
    while (step());
    grpc::Status status;
    stream->Finish(&status, nullptr);
    step();
    return status;
  }

  static std::vector<const google::protobuf::MethodDescriptor*> methods() {
    std::vector<const google::protobuf::MethodDescriptor*> all;
    for (const google::protobuf::FileDescriptor* file :
         {v1::Job::descriptor()->file(), v1::Blob::descriptor()->file(), v1::Limits::descriptor()->file()})
      for (int s = 0; s < file->service_count(); ++s)
        for (int m = 0; m < file->service(s)->method_count(); ++m) all.push_back(file->service(s)->method(m));
    return all;
  }

  grpc::Status create_as(const std::string& key, v1::Job& job) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + key);
    v1::CreateJobResponse response;
    const grpc::Status status = job_stub_->CreateJob(&context, tetrahedron_job(), &response);
    job = response.job();
    return status;
  }

  grpc::Status get_as(const std::string& key, const std::string& job_id) {
    grpc::ClientContext context;
    context.AddMetadata("x-api-key", key);
    v1::GetJobRequest request;
    request.set_job_id(job_id);
    v1::GetJobResponse response;
    return job_stub_->GetJob(&context, request, &response);
  }

  std::string path_;
};

TEST_F(Auth, EveryCallIsRefusedWithoutTheRightKey) {
  EXPECT_GE(methods().size(), 15u);
  for (const auto* method : methods())
    for (const char* key : {"", "wrong", "Bearer"}) {
      const grpc::Status status = call(*method, key);
      EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAUTHENTICATED) << method->full_name() << " with '" << key << "'";
      EXPECT_EQ(reason_of(status), "UNAUTHENTICATED") << method->full_name();
    }
}

TEST_F(Auth, ViewersAreRefusedEveryCallThatChangesSomething) {
  const std::vector<std::string> looking = {"GetJob", "ListJobs", "WatchJob", "ReadBlob", "GetBlob", "GetCapabilities", "GetServerStatus"};
  for (const auto* method : methods()) {
    const bool may = std::find(looking.begin(), looking.end(), method->name()) != looking.end();
    EXPECT_EQ(call(*method, "key of vic").error_code() == grpc::StatusCode::PERMISSION_DENIED, !may) << method->full_name();
  }
}

TEST_F(Auth, JobsAndBlobsOfOtherTenantsDoNotExist) {
  v1::Job job;
  ASSERT_TRUE(create_as("key of ann", job).ok());
  EXPECT_EQ(job.tenant(), "a");
  EXPECT_TRUE(get_as("key of ann", job.job_id()).ok());
  EXPECT_TRUE(get_as("key of vic", job.job_id()).ok());
  EXPECT_TRUE(get_as("key of root", job.job_id()).ok());
  const grpc::Status other = get_as("key of bob", job.job_id());
  EXPECT_EQ(other.error_code(), grpc::StatusCode::NOT_FOUND);
  const grpc::Status nobody = get_as("key of bob", random_id());
  EXPECT_EQ(reason_of(other), reason_of(nobody)) << "nothing tells them apart";

  const auto as_bob = [](grpc::ClientContext& context) { context.AddMetadata("x-api-key", "key of bob"); };
  v1::CancelJobRequest cancel;
  cancel.set_job_id(job.job_id());
  v1::CancelJobResponse cancelled;
  grpc::ClientContext first;
  as_bob(first);
  EXPECT_EQ(job_stub_->CancelJob(&first, cancel, &cancelled).error_code(), grpc::StatusCode::NOT_FOUND);
  v1::DeleteJobRequest remove;
  remove.set_job_id(job.job_id());
  v1::DeleteJobResponse removed;
  grpc::ClientContext second;
  as_bob(second);
  EXPECT_EQ(job_stub_->DeleteJob(&second, remove, &removed).error_code(), grpc::StatusCode::NOT_FOUND);
  v1::WatchJobRequest watch;
  watch.set_job_id(job.job_id());
  grpc::ClientContext third;
  as_bob(third);
  EXPECT_EQ(job_stub_->WatchJob(&third, watch)->Finish().error_code(), grpc::StatusCode::NOT_FOUND);
  grpc::ClientContext fourth;
  as_bob(fourth);
  v1::ListJobsResponse listed;
  ASSERT_TRUE(job_stub_->ListJobs(&fourth, {}, &listed).ok());
  EXPECT_EQ(listed.jobs_size(), 0);

  const auto done = [&] {
    for (int i = 0; i < 1000; ++i, std::this_thread::sleep_for(5ms))
      if (const v1::Job now = desk_->get(Caller{}, job.job_id()); now.state() >= v1::JOB_STATE_SUCCEEDED) return now;
    return v1::Job();
  }();
  ASSERT_EQ(done.artifacts_size(), 1);
  v1::GetBlobRequest blob;
  blob.set_blob_id(done.artifacts(0).blob().blob_id());
  v1::GetBlobResponse answer;
  grpc::ClientContext fifth, sixth;
  as_bob(fifth);
  EXPECT_EQ(blob_stub_->GetBlob(&fifth, blob, &answer).error_code(), grpc::StatusCode::NOT_FOUND);
  sixth.AddMetadata("x-api-key", "key of vic");
  EXPECT_TRUE(blob_stub_->GetBlob(&sixth, blob, &answer).ok());
}

TEST_F(Auth, ATenantsQuotaIsItsOwn) {
  mesher_.hold();
  v1::Job job;
  ASSERT_TRUE(create_as("key of ann", job).ok());  // takes the slot
  for (int i = 0; i < 1000 && desk_->load().running == 0; ++i) std::this_thread::sleep_for(2ms);
  ASSERT_TRUE(create_as("key of bob", job).ok());
  const grpc::Status refused = create_as("key of bob", job);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(reason_of(refused), "TENANT_QUOTA");
  EXPECT_GT(retry_of(refused), 0);
  EXPECT_TRUE(create_as("key of ann", job).ok());
  mesher_.release();
}

TEST_F(Auth, WhatATenantAnnouncesCountsAgainstItsQuota) {
  const auto announce = [this](const std::string& key, std::int64_t size) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + key);
    v1::StartUploadRequest request;
    request.set_size_bytes(size);
    v1::StartUploadResponse response;
    return blob_stub_->StartUpload(&context, request, &response);
  };
  const grpc::Status never = announce("key of bob", 100001);
  EXPECT_EQ(reason_of(never), "TENANT_QUOTA");
  EXPECT_EQ(retry_of(never), 0);
  EXPECT_TRUE(announce("key of bob", 60000).ok());
  const grpc::Status refused = announce("key of bob", 60000);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(reason_of(refused), "TENANT_QUOTA");
  EXPECT_TRUE(announce("key of ann", 1 << 30).ok());
  blobs_->drop_uploads_idle_since(std::chrono::system_clock::now() + 1h);
  EXPECT_TRUE(announce("key of bob", 60000).ok());
}

}  // namespace
}  // namespace strata::server
