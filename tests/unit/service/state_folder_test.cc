#include "server/service/state_folder.h"

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "tests/support/process.h"

namespace calib::service {
namespace {

TEST(StateFolder, BelongsToOneServerAtATimeAndSaysWhere) {
  const std::string folder = testing::FreshFolder("state-folder") + "/new/state";
  EXPECT_EQ(ServingAddress(folder).status().code(), absl::StatusCode::kNotFound);
  {
    auto owner = StateFolder::Open(folder);
    ASSERT_TRUE(owner.ok()) << owner.status();
    EXPECT_EQ(ServingAddress(folder).status().code(), absl::StatusCode::kUnavailable)
        << "it has not announced itself yet";
    ASSERT_TRUE((*owner)->Announce("127.0.0.1:4711").ok());
    EXPECT_EQ(*ServingAddress(folder), "127.0.0.1:4711");
    EXPECT_FALSE(IsServedForGood(folder));
    ASSERT_TRUE((*owner)->Announce("127.0.0.1:4711", /*stays=*/true).ok());
    EXPECT_TRUE(IsServedForGood(folder));
    const auto second = StateFolder::Open(folder);
    EXPECT_EQ(second.status().code(), absl::StatusCode::kAlreadyExists);
    EXPECT_NE(second.status().message().find("127.0.0.1:4711"), std::string::npos);
  }
  EXPECT_EQ(ServingAddress(folder).status().code(), absl::StatusCode::kNotFound);
  EXPECT_TRUE(StateFolder::Open(folder).ok());
}

TEST(StateFolder, WhoLooksNeverKeepsAServerFromStarting) {
  const std::string folder = testing::FreshFolder("state-folder-looked-at");
  ASSERT_TRUE(StateFolder::Open(folder).ok());
  std::atomic<bool> stop = false;
  std::thread onlooker([&] {
    while (!stop) {
      (void)ServingAddress(folder);
    }
  });
  for (int start = 0; start < 2000; ++start) {
    const auto owner = StateFolder::Open(folder);
    EXPECT_TRUE(owner.ok()) << "start " << start << ": " << owner.status();
  }
  stop = true;
  onlooker.join();
}

TEST(StateFolder, FolderThatCannotBeMadeIsNamed) {
  const auto folder = StateFolder::Open("/proc/calib");
  EXPECT_EQ(folder.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(folder.status().message().find("/proc/calib"), std::string::npos);
}

}  // namespace
}  // namespace calib::service
