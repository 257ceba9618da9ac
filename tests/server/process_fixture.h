// Runs jobs in processes of their own, by a worker that misbehaves as the surface tells it (faulty_worker.cpp).
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/ids.h"
#include "server/job_runner.h"

namespace strata::server {

// Keeps what the jobs said.
class ProcessFixture : public testing::Test {
 protected:
  struct Run {
    v1::Job job;
    std::vector<v1::WatchJobResponse> events;
    bool ended = false;
  };

  void SetUp() override {
    folder_ = (std::filesystem::temp_directory_path() / ("strata-runner-" + random_id())).string();
    std::filesystem::create_directories(folder_);
    blobs_ = open_file_blob_store(folder_);
    runner_ = make_process_runner({2, FAULTY_WORKER}, *blobs_, memory_);
  }
  void TearDown() override {
    runner_.reset();
    EXPECT_TRUE(std::filesystem::is_empty(folder_ + "/temporary")) << "a worker left something behind";
    EXPECT_EQ(memory_.reserved(), 0);
    std::filesystem::remove_all(folder_);
  }

  std::string start(const std::string& fault) {
    const auto writer = blobs_->create("");
    writer->write("solid " + fault +
                  "\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n");
    JobOrder order;
    order.job_id = random_id();
    order.request.mutable_surface()->set_blob_id(writer->publish().id);
    order.request.mutable_surface()->set_format(v1::SURFACE_FORMAT_STL);
    order.request.mutable_spec();
    order.request.add_outputs(v1::OUTPUT_FORMAT_BLOCKS);
    return start(std::move(order));
  }

  std::string start(JobOrder order) {
    const std::string id = order.job_id;
    runner_->start(
        std::move(order),
        [this, id](v1::WatchJobResponse event) {
          const std::lock_guard lock(mutex_);
          runs_[id].events.push_back(std::move(event));
          changed_.notify_all();
        },
        [this, id](v1::Job job) {
          const std::lock_guard lock(mutex_);
          runs_[id].job = std::move(job);
          runs_[id].ended = true;
          changed_.notify_all();
        });
    return id;
  }

  Run wait(const std::string& id) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, std::chrono::seconds(60), [&] { return runs_[id].ended; }));
    return runs_[id];
  }

  void wait_for_progress(const std::string& id) {
    std::unique_lock lock(mutex_);
    const auto progressed = [](const v1::WatchJobResponse& e) { return e.progress().stage() == v1::STAGE_FIT_TO_SMOOTH; };
    EXPECT_TRUE(changed_.wait_for(lock, std::chrono::seconds(60), [&] {
      const auto& events = runs_[id].events;
      return std::any_of(events.begin(), events.end(), progressed);
    }));
  }

  std::string folder_;
  MemoryLedger memory_{std::int64_t{2} << 30};
  std::unique_ptr<BlobStore> blobs_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, Run> runs_;
  std::unique_ptr<JobRunner> runner_;
};

}  // namespace strata::server
