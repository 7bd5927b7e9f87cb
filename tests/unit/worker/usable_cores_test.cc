#include "worker/usable_cores.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

namespace calib::worker {
namespace {

class ControlGroups : public ::testing::Test {
 protected:
  ControlGroups() : root_(::testing::TempDir() + "groups" + std::to_string(getpid())) {
    std::filesystem::remove_all(root_);
  }
  ~ControlGroups() override { std::filesystem::remove_all(root_); }

  void Write(const std::string& name, const std::string& text) const {
    const std::filesystem::path path = root_ + "/" + name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  int Cores() const { return UsableCores(root_, root_ + "/own"); }

  const std::string root_;
  const int all_ = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
};

TEST_F(ControlGroups, WithoutAQuotaAllCoresOfTheAffinityCount) {
  EXPECT_EQ(Cores(), all_) << "no such file";
  Write("own", "0::/a/b\n");
  Write("a/b/cpu.max", "max 100000\n");
  EXPECT_EQ(Cores(), all_);
}

TEST_F(ControlGroups, TheSmallestQuotaOnTheWayUpCounts) {
  Write("own", "0::/a/b\n");
  Write("a/cpu.max", "100000 100000\n");
  Write("a/b/cpu.max", "300000 100000\n");
  EXPECT_EQ(Cores(), 1);
}

TEST_F(ControlGroups, OneInAContainerCountsToo) {
  Write("own", "0::/of/the/host\n");
  Write("cpu.max", "150000 100000\n");
  EXPECT_EQ(Cores(), 1) << "1.5 cores are one slot";
}

TEST_F(ControlGroups, OfVersionOneCountToo) {
  Write("own", "5:cpuset:/x\n3:cpu,cpuacct:/x\n");
  Write("cpu/x/cpu.cfs_quota_us", "100000\n");
  Write("cpu/x/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(Cores(), 1);
  Write("cpu/x/cpu.cfs_quota_us", "-1\n");
  EXPECT_EQ(Cores(), all_);
}

TEST_F(ControlGroups, LessThanACoreIsOneSlotAllTheSame) {
  Write("own", "0::/\n");
  Write("cpu.max", "10000 100000\n");
  EXPECT_EQ(Cores(), 1);
}

TEST_F(ControlGroups, MemoryIsThatOfTheMachineOrOfTheSmallestGroup) {
  const auto memory = [this] { return UsableMemory(root_, root_ + "/own", root_ + "/meminfo"); };
  EXPECT_EQ(memory(), 0) << "nobody knows";
  Write("meminfo", "MemTotal:       16337240 kB\nMemFree: 1 kB\n");
  Write("own", "0::/a/b\n");
  EXPECT_EQ(memory(), 16'640e6) << "in whole grains";
  Write("a/b/memory.max", "max\n");
  EXPECT_EQ(memory(), 16'640e6);
  Write("a/memory.max", "4000000000\n");
  EXPECT_EQ(memory(), 3'840e6);
  Write("own", "7:memory:/x\n");
  Write("memory/x/memory.limit_in_bytes", "100000000\n");
  EXPECT_EQ(memory(), 100e6) << "less than a grain as it is";
  EXPECT_GT(UsableMemory(), 0) << "of this machine";
}

}  // namespace
}  // namespace calib::worker
