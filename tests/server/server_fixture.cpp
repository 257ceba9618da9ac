#include "tests/server/server_fixture.h"

#include <filesystem>
#include <thread>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "proto/wire/crc32c.h"
#include "server/ids.h"
#include "server/status.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr const char* kTetrahedron = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

}  // namespace

void ServerFixture::start(TestOptions options) {
  folder_ = (fs::temp_directory_path() / ("strata-rpc-" + random_id())).string();
  fs::create_directories(folder_);
  blobs_ = open_file_blob_store(folder_);
  jobs_ = make_memory_job_store();
  runner_ = make_thread_runner(options.slots, *blobs_, memory_, mesher_.door());
  metrics_ = std::make_unique<Metrics>();
  tracer_ = std::make_unique<Tracer>(options.trace_file);
  traced_ = trace_jobs(*runner_, *tracer_);
  const bool watched = !options.trace_file.empty();
  options.desk.generator = "test";
  checker_ = make_thread_checker(*blobs_, mesher_.door(), options.desk.admission.memory_budget_bytes);
  gate_ = std::make_unique<Gate>(options.auth_file);
  options.desk.limits_of = [this](const std::string& tenant) { return gate_->limits_of(tenant); };
  desk_ = std::make_unique<JobDesk>(*jobs_, *blobs_, *traced_, *checker_, mesher_.door(), options.desk);
  ServerOptions wire;
  wire.listen = {"unix:" + folder_ + "/socket"};
  if (!options.listen.empty()) wire.listen.push_back(options.listen);
  wire.max_connections = options.max_connections;
  wire.max_transfers = options.max_transfers;
  wire.stall_seconds = options.stall_seconds;
  wire.limits = options.limits;
  server_ = std::make_unique<Server>(wire, watched ? watch_calls(*metrics_, *tracer_) : Server::CallWatchers(), *gate_, *desk_, *blobs_);
  channel_ = grpc::CreateChannel(server_->addresses().front(), grpc::InsecureChannelCredentials());
  job_stub_ = v1::JobService::NewStub(channel_);
  blob_stub_ = v1::BlobService::NewStub(channel_);
  system_stub_ = v1::SystemService::NewStub(channel_);
}

void ServerFixture::TearDown() {
  mesher_.release();
  server_.reset();
  desk_.reset();
  traced_.reset();
  runner_.reset();
  fs::remove_all(folder_);
}

v1::CreateJobRequest ServerFixture::tetrahedron_job() {
  v1::CreateJobRequest request;
  request.mutable_surface()->set_data(kTetrahedron);
  request.mutable_surface()->set_format(v1::SURFACE_FORMAT_OFF);
  return request;
}

v1::Job ServerFixture::create(const v1::CreateJobRequest& request) {
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  const grpc::Status status = job_stub_->CreateJob(&context, request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.job();
}

v1::Job ServerFixture::get(const std::string& job_id) {
  grpc::ClientContext context;
  v1::GetJobRequest request;
  request.set_job_id(job_id);
  v1::GetJobResponse response;
  job_stub_->GetJob(&context, request, &response);
  return response.job();
}

v1::Job ServerFixture::wait_final(const std::string& job_id) {
  for (int i = 0; i < 2000; ++i) {
    v1::Job job = get(job_id);
    if (job.state() >= v1::JOB_STATE_SUCCEEDED) return job;
    std::this_thread::sleep_for(5ms);
  }
  ADD_FAILURE() << "the job did not end";
  return {};
}

std::string ServerFixture::upload(const std::string& bytes, std::size_t frame) {
  v1::StartUploadRequest start;
  start.set_size_bytes(static_cast<std::int64_t>(bytes.size()));
  v1::StartUploadResponse started;
  {
    grpc::ClientContext context;
    EXPECT_TRUE(blob_stub_->StartUpload(&context, start, &started).ok());
  }
  grpc::ClientContext context;
  v1::WriteBlobResponse response;
  const auto writer = blob_stub_->WriteBlob(&context, &response);
  for (std::size_t at = 0; at < bytes.size(); at += frame) {
    v1::WriteBlobRequest request;
    request.set_upload_id(started.upload_id());
    *request.mutable_frame() = frame_of(static_cast<std::int64_t>(at), bytes.substr(at, frame));
    writer->Write(request);
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.blob().blob_id();
}

grpc::Status ServerFixture::read(const std::string& blob_id, std::int64_t offset, std::string& bytes) {
  grpc::ClientContext context;
  v1::ReadBlobRequest request;
  request.set_blob_id(blob_id);
  request.set_offset(offset);
  const auto reader = blob_stub_->ReadBlob(&context, request);
  v1::ReadBlobResponse response;
  bool first = true;
  while (reader->Read(&response)) {
    EXPECT_EQ(response.has_blob(), std::exchange(first, false));
    if (!response.has_frame()) continue;
    EXPECT_EQ(response.frame().offset(), offset + static_cast<std::int64_t>(bytes.size()));
    EXPECT_EQ(response.frame().crc32c(), wire::crc32c(response.frame().data()));
    bytes += response.frame().data();
  }
  return reader->Finish();
}

v1::Frame frame_of(std::int64_t offset, const std::string& data) {
  v1::Frame frame;
  frame.set_offset(offset);
  frame.set_data(data);
  frame.set_crc32c(wire::crc32c(data));
  return frame;
}

namespace {

template <class Detail>
Detail detail_of(const grpc::Status& status) {
  EXPECT_LE(status.error_details().size(), kMaxDetailBytes);
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(status.error_details()));
  EXPECT_EQ(details.code(), status.error_code());
  Detail detail;
  for (const auto& any : details.details())
    if (any.UnpackTo(&detail)) break;
  return detail;
}

}  // namespace

std::string reason_of(const grpc::Status& status) { return detail_of<google::rpc::ErrorInfo>(status).reason(); }

std::string field_of(const grpc::Status& status) {
  const auto bad = detail_of<google::rpc::BadRequest>(status);
  return bad.field_violations_size() > 0 ? bad.field_violations(0).field() : "";
}

double retry_of(const grpc::Status& status) {
  const auto delay = detail_of<google::rpc::RetryInfo>(status).retry_delay();
  return static_cast<double>(delay.seconds()) + 1e-9 * delay.nanos();
}

}  // namespace strata::server
