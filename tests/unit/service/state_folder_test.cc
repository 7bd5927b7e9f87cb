#include "server/service/state_folder.h"

#include <gtest/gtest.h>

#include <filesystem>

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
    const auto second = StateFolder::Open(folder);
    EXPECT_EQ(second.status().code(), absl::StatusCode::kAlreadyExists);
    EXPECT_NE(second.status().message().find("127.0.0.1:4711"), std::string::npos);
  }
  EXPECT_EQ(ServingAddress(folder).status().code(), absl::StatusCode::kNotFound);
  EXPECT_TRUE(StateFolder::Open(folder).ok());
}

TEST(StateFolder, FolderThatCannotBeMadeIsNamed) {
  const auto folder = StateFolder::Open("/proc/calib");
  EXPECT_EQ(folder.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(folder.status().message().find("/proc/calib"), std::string::npos);
}

}  // namespace
}  // namespace calib::service
