#include "worker/engine/shared_content.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>
#include <vector>

namespace calib::worker {
namespace {

class SharedFolder : public ::testing::Test {
 protected:
  SharedFolder() : folder_(::testing::TempDir() + "shared" + std::to_string(getpid())) {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directory(folder_);
  }
  ~SharedFolder() override { std::filesystem::remove_all(folder_); }

  const std::string folder_;
};

TEST_F(SharedFolder, IsMadeOnceForAll) {
  std::atomic<int> made = 0;
  std::vector<std::jthread> slots;
  for (int i = 0; i < 4; ++i) {
    slots.emplace_back([&] {
      const SharedContent content(folder_);
      const auto got = content.Get("k", {}, [&]() -> absl::StatusOr<std::string> {
        ++made;
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        return std::string("a\0b", 3);
      });
      ASSERT_TRUE(got.ok()) << got.status();
      EXPECT_EQ(*got, std::string("a\0b", 3));
    });
  }
  slots.clear();
  EXPECT_EQ(made, 1);
}

TEST_F(SharedFolder, IsMadeAgainWhereTheMakerFailedOrDied) {
  const SharedContent content(folder_);
  const auto failed =
      content.Get("k", {}, [] { return absl::StatusOr<std::string>(absl::NotFoundError("no")); });
  EXPECT_EQ(failed.status(), absl::NotFoundError("no"));
  const pid_t child = fork();
  if (child == 0) {
    content.Get("k", {}, []() -> absl::StatusOr<std::string> { _exit(7); }).IgnoreError();
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_EQ(WEXITSTATUS(status), 7);
  const auto got = content.Get("k", {}, [] { return absl::StatusOr<std::string>("made"); });
  ASSERT_TRUE(got.ok()) << got.status();
  EXPECT_EQ(*got, "made");
}

TEST_F(SharedFolder, WhoIsStoppedDoesNotWait) {
  const SharedContent content(folder_);
  std::atomic<bool> begun = false;
  std::atomic<bool> go_on = false;
  const std::jthread maker([&] {
    content
        .Get("k", {},
             [&]() -> absl::StatusOr<std::string> {
               begun = true;
               while (!go_on) std::this_thread::yield();
               return "made";
             })
        .IgnoreError();
  });
  while (!begun) std::this_thread::yield();
  std::stop_source stop;
  stop.request_stop();
  const auto left =
      content.Get("k", stop.get_token(), [] { return absl::StatusOr<std::string>("mine"); });
  EXPECT_EQ(left.status().code(), absl::StatusCode::kCancelled);
  go_on = true;
}

TEST_F(SharedFolder, WithoutAFolderEverybodyMakesItsOwn) {
  for (const std::string& folder : {std::string(), std::string("/nowhere/at/all")}) {
    const auto got =
        SharedContent(folder).Get("k", {}, [] { return absl::StatusOr<std::string>("made"); });
    ASSERT_TRUE(got.ok()) << folder << got.status();
    EXPECT_EQ(*got, "made");
  }
}

}  // namespace
}  // namespace calib::worker
