// A real stratad under load, from outside. Short by default; STRATA_LONG=1 for the figures of docs/limits.md. Tests print what they measured.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "core/base/vec3.h"
#include "strata/v1/blob.grpc.pb.h"
#include "strata/v1/job.grpc.pb.h"
#include "tests/server/daemon.h"
#include "tests/server/server_fixture.h"

namespace strata::server {

using Clock = std::chrono::steady_clock;

inline constexpr std::int64_t kMiB = std::int64_t{1} << 20;

inline double seconds_since(Clock::time_point begun) { return std::chrono::duration<double>(Clock::now() - begun).count(); }

// A surface that the faulty worker obeys ("fine", "wait").
inline std::string word(const std::string& what) {
  return "solid " + what + "\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
}

// An octahedron cut finer, on the unit sphere: something to mesh for a while.
inline std::string ball(int n) {
  std::string points, faces;
  int count = 0, triangles = 0;
  const auto point = [&](Vec3 p) {
    p.normalize();
    char line[96];
    std::snprintf(line, sizeof line, "%.9g %.9g %.9g\n", p.x(), p.y(), p.z());
    points += line;
    return count++;
  };
  const auto face = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
    const int i = point(a), j = point(b), k = point(c);
    faces += "3 " + std::to_string(i) + " " + std::to_string(j) + " " + std::to_string(k) + "\n";
    ++triangles;
  };
  for (int octant = 0; octant < 8; ++octant) {
    const Vec3 sign((octant & 1) != 0 ? -1 : 1, (octant & 2) != 0 ? -1 : 1, (octant & 4) != 0 ? -1 : 1);
    const bool turned = sign.prod() < 0;
    const auto at = [&](int i, int j) { return Vec3(sign.x() * i, sign.y() * j, sign.z() * (n - i - j)); };
    const auto add = [&](const Vec3& a, const Vec3& b, const Vec3& c) { turned ? face(a, c, b) : face(a, b, c); };
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j) {
        add(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + j + 1 < n) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      }
  }
  return "OFF\n" + std::to_string(count) + " " + std::to_string(triangles) + " 0\n" + points + faces;
}

class Load : public testing::Test {
 protected:
  void start(const std::vector<std::string>& flags) {
    daemon_ = std::make_unique<Daemon>(flags);
    meet();
  }
  void meet() {
    channel_ = daemon_->connect();
    jobs_ = v1::JobService::NewStub(channel_);
    blobs_ = v1::BlobService::NewStub(channel_);
  }

  static v1::CreateJobRequest job_of(const std::string& surface, v1::SurfaceFormat format, double size = 0) {
    v1::CreateJobRequest request;
    request.mutable_surface()->set_data(surface);
    request.mutable_surface()->set_format(format);
    if (size > 0) request.mutable_spec()->mutable_sizing()->set_max_size(size);
    return request;
  }

  std::string submit(const v1::CreateJobRequest& request) {
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    const grpc::Status status = jobs_->CreateJob(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.job().job_id();
  }

  v1::Job get(const std::string& id) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::GetJobResponse response;
    EXPECT_TRUE(jobs_->GetJob(&context, request, &response).ok());
    return response.job();
  }

  void cancel(const std::string& id) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_job_id(id);
    v1::CancelJobResponse response;
    EXPECT_TRUE(jobs_->CancelJob(&context, request, &response).ok());
  }

  // All that is told of a job, to its end.
  std::vector<v1::WatchJobResponse> watch(const std::string& id) {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_job_id(id);
    const auto reader = jobs_->WatchJob(&context, request);
    std::vector<v1::WatchJobResponse> events;
    for (v1::WatchJobResponse event; reader->Read(&event);) events.push_back(event);
    EXPECT_TRUE(reader->Finish().ok());
    return events;
  }

  v1::ListJobsResponse list() {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    EXPECT_TRUE(jobs_->ListJobs(&context, {}, &response).ok());
    return response;
  }

  std::unique_ptr<Daemon> daemon_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::BlobService::Stub> blobs_;
};

}  // namespace strata::server
