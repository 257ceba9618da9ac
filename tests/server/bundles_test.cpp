// Failures of ours leave what is needed to look into them.
#include "server/bundles.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "server/spec_json.h"
#include "tests/server/process_fixture.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

class Bundles : public ProcessFixture {
 protected:
  void SetUp() override {
    ProcessFixture::SetUp();
    inner_ = std::move(runner_);
    runner_ = keep_bundles(*inner_, *blobs_, {folder_ + "/bundles", 2, "test"});
  }
  void TearDown() override {
    runner_.reset();
    inner_.reset();
    ProcessFixture::TearDown();
  }
  [[nodiscard]] std::set<fs::path> kept() const {
    std::set<fs::path> all;
    if (fs::exists(folder_ + "/bundles"))
      for (const auto& entry : fs::directory_iterator(folder_ + "/bundles")) all.insert(entry.path());
    return all;
  }
  static std::string text_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::unique_ptr<JobRunner> inner_;
};

TEST_F(Bundles, ACrashKeepsSurfaceSpecificationAndRecord) {
  const std::string id = start("segv");
  const v1::Job job = wait(id).job;
  ASSERT_EQ(kept().size(), 1u);
  const fs::path bundle = *kept().begin();
  EXPECT_NE(job.error().message().find("kept as bundle " + bundle.filename().string()), std::string::npos) << job.error().message();
  EXPECT_NE(bundle.filename().string().find(id), std::string::npos);
  EXPECT_NE(text_of(bundle / "surface.stl").find("solid segv"), std::string::npos);
  EXPECT_NO_THROW(parse_spec(text_of(bundle / "spec.json")));
  EXPECT_NE(text_of(bundle / "job.json").find("break_down_here"), std::string::npos);
  EXPECT_NE(text_of(bundle / "README").find("strata mesh surface.stl --spec spec.json"), std::string::npos);
}

TEST_F(Bundles, OnlyFailuresOfOursAreKeptAndTheOldestGo) {
  wait(start("fine"));
  wait(start("greedy"));
  EXPECT_TRUE(kept().empty());
  wait(start("throw"));
  const std::set<fs::path> first = kept();
  ASSERT_EQ(first.size(), 1u);
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // names count seconds
  wait(start("abort"));
  wait(start("exit"));
  EXPECT_EQ(kept().size(), 2u);
  EXPECT_FALSE(kept().contains(*first.begin()));
}

TEST_F(Bundles, ArraysBecomeAFileThatCanBeMeshed) {
  const double points[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::uint32_t triangles[] = {0, 2, 1, 0, 1, 3};
  const std::int32_t patches[] = {1, 0};
  const auto writer = blobs_->create("");
  for (const std::string_view piece : {std::string_view(reinterpret_cast<const char*>(points), sizeof points),
                                       std::string_view(reinterpret_cast<const char*>(triangles), sizeof triangles),
                                       std::string_view(reinterpret_cast<const char*>(patches), sizeof patches)})
    writer->write(piece);
  JobOrder order;
  order.job_id = random_id();
  v1::Surface& surface = *order.request.mutable_surface();
  surface.set_blob_id(writer->publish().id);
  surface.set_format(v1::SURFACE_FORMAT_ARRAYS);
  surface.mutable_arrays()->set_point_count(4);
  surface.mutable_arrays()->set_triangle_count(2);
  surface.mutable_arrays()->add_patch_names("segv");
  surface.mutable_arrays()->add_patch_names("wall");
  order.request.mutable_spec();
  order.request.add_outputs(v1::OUTPUT_FORMAT_BLOCKS);
  wait(start(std::move(order)));
  ASSERT_EQ(kept().size(), 1u);
  const std::string stl = text_of(*kept().begin() / "surface.stl");
  EXPECT_LT(stl.find("solid segv"), stl.find("solid wall"));
  EXPECT_NE(stl.find("vertex 0 0 1"), std::string::npos);
}

}  // namespace
}  // namespace strata::server
