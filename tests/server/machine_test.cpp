#include "server/machine.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "server/ids.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kGiB = std::int64_t{1} << 30;

// A machine's /proc and /sys, as far as they are looked at.
class ControlGroups : public testing::Test {
 protected:
  ControlGroups() : root_((fs::temp_directory_path() / ("strata-groups-" + random_id())).string()) {}
  ~ControlGroups() override { fs::remove_all(root_); }

  void put(const std::string& path, const std::string& text) const {
    fs::create_directories(fs::path(root_ + path).parent_path());
    std::ofstream(root_ + path) << text << "\n";
  }
  [[nodiscard]] GroupLimits limits() const { return group_limits(root_); }

 private:
  const std::string root_;
};

TEST_F(ControlGroups, WithoutAnyThereIsNoLimit) {
  EXPECT_EQ(limits().cores, 0);
  EXPECT_EQ(limits().memory_bytes, 0);
}

TEST_F(ControlGroups, TheNarrowestOfThoseAroundCounts) {
  put("/proc/self/cgroup", "0::/system.slice/stratad.service");
  put("/sys/fs/cgroup/system.slice/stratad.service/cpu.max", "max 100000");
  put("/sys/fs/cgroup/system.slice/stratad.service/memory.max", "8589934592");
  put("/sys/fs/cgroup/system.slice/cpu.max", "150000 100000");
  put("/sys/fs/cgroup/system.slice/memory.max", "max");
  EXPECT_DOUBLE_EQ(limits().cores, 1.5);
  EXPECT_EQ(limits().memory_bytes, 8 * kGiB);
  put("/sys/fs/cgroup/system.slice/memory.max", "4294967296");
  EXPECT_EQ(limits().memory_bytes, 4 * kGiB);
}

TEST_F(ControlGroups, AContainerSeesItsOwnAtTheTop) {
  put("/proc/self/cgroup", "0::/");
  put("/sys/fs/cgroup/cpu.max", "400000 100000");
  put("/sys/fs/cgroup/memory.max", "17179869184");
  EXPECT_DOUBLE_EQ(limits().cores, 4);
  EXPECT_EQ(limits().memory_bytes, 16 * kGiB);
}

TEST_F(ControlGroups, TheFirstVersionIsReadToo) {
  put("/proc/self/cgroup", "5:memory:/docker/abc\n3:cpu,cpuacct:/docker/abc\n1:name=systemd:/docker/abc");
  put("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "200000");
  put("/sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000");
  put("/sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712");
  EXPECT_DOUBLE_EQ(limits().cores, 2);
  EXPECT_EQ(limits().memory_bytes, 0) << "this number means that there is none";
  put("/sys/fs/cgroup/memory/docker/abc/memory.limit_in_bytes", "2147483648");
  put("/sys/fs/cgroup/cpu/docker/abc/cpu.cfs_quota_us", "-1");
  put("/sys/fs/cgroup/cpu/docker/abc/cpu.cfs_period_us", "100000");
  EXPECT_DOUBLE_EQ(limits().cores, 2);
  EXPECT_EQ(limits().memory_bytes, 2 * kGiB);
}

TEST(Machine, HasACoreAndSomeMemory) {
  EXPECT_GE(usable_cores(), 1);
  EXPECT_GT(usable_memory(), 0);
}

}  // namespace
}  // namespace strata::server
