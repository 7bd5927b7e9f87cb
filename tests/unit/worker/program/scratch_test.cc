#include "worker/program/scratch.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include "tests/unit/worker/program/program_of_test.h"

namespace calib::worker {
namespace {

using ::calib::worker::testing::Contents;
using ::calib::worker::testing::TemporaryFolder;

std::string ReadText(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

Scratch::Files Listed(const std::string& name, const std::string& digest) {
  Scratch::Files files;
  files.Add()->set_name(name);
  files[0].set_digest(digest);
  return files;
}

std::size_t FoldersIn(const std::string& root) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(root)) {
    count += entry.is_directory() ? 1 : 0;
  }
  return count;
}

TEST(Scratch, FoldersGoWithTheirObjects) {
  const TemporaryFolder folder;
  Contents contents;
  const std::string root = folder.path() + "/a/b";
  {
    const auto scratch = Scratch::Open(root, contents.AsFetch());
    ASSERT_TRUE(scratch.ok()) << scratch.status();
    std::string path;
    {
      auto run = (*scratch)->MakeRunFolder();
      ASSERT_TRUE(run.ok()) << run.status();
      path = run->path();
      std::filesystem::create_directories(path + "/deep/er");
      std::ofstream(path + "/deep/er/file") << "x";
      std::filesystem::permissions(path + "/deep", std::filesystem::perms::none);
    }
    EXPECT_FALSE(std::filesystem::exists(path));
    EXPECT_NE((*scratch)->MakeRunFolder()->path(), path);
    EXPECT_EQ(FoldersIn(root), 1U);
  }
  EXPECT_EQ(FoldersIn(root), 0U);
}

TEST(Scratch, FoldersOfDeadWorkersAreRemovedAndThoseOfOthersStay) {
  const TemporaryFolder folder;
  Contents contents;
  const std::string dead = folder.path() + "/worker-dead/run-1";
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_all);
  std::filesystem::create_directories(dead);
  std::filesystem::create_directories(folder.path() + "/mine");
  const auto first = Scratch::Open(folder.path(), contents.AsFetch());
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_FALSE(std::filesystem::exists(dead));
  const auto run = (*first)->MakeRunFolder();
  const auto second = Scratch::Open(folder.path(), contents.AsFetch());
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_TRUE(std::filesystem::exists(run->path()));
  EXPECT_TRUE(std::filesystem::exists(folder.path() + "/mine"));
}

TEST(Scratch, AFolderOfOthersIsNotTaken) {
  const TemporaryFolder folder;
  Contents contents;
  std::filesystem::permissions(folder.path(), std::filesystem::perms::all);
  EXPECT_EQ(Scratch::Open(folder.path(), contents.AsFetch()).status().code(),
            absl::StatusCode::kUnavailable);
  std::filesystem::create_directory_symlink("/tmp", folder.path() + "/link");
  EXPECT_FALSE(Scratch::Open(folder.path() + "/link", contents.AsFetch()).ok());
}

TEST(Scratch, FilesAreCopiedAndTemplatesAreFilled) {
  const TemporaryFolder folder;
  Contents contents;
  const auto scratch = Scratch::Open(folder.path() + "/s", contents.AsFetch());
  const auto one = (*scratch)->MakeRunFolder();
  const auto two = (*scratch)->MakeRunFolder();
  Scratch::Files files = Listed("deep/model", contents.Add("text {a}"));
  files[0].set_executable(true);
  v1::ProgramFile& input = *files.Add();
  input = Listed("in", contents.Add("v = {a}, ${a}"))[0];
  input.set_is_template(true);
  for (const auto* run : {&one, &two}) {
    ASSERT_TRUE((*scratch)->CopyFiles(files, (*run)->path(), {}).ok());
    ASSERT_TRUE((*scratch)->WriteTemplates(files, {{"a", "1"}}, (*run)->path(), {}).ok());
  }
  EXPECT_EQ(contents.fetches(), 2);
  EXPECT_EQ(ReadText(one->path() + "/in"), "v = 1, ${a}");
  EXPECT_EQ(access((one->path() + "/deep/model").c_str(), X_OK), 0);
  struct stat found {};
  ASSERT_EQ(stat((one->path() + "/in").c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777U, 0600U);
  std::ofstream(one->path() + "/deep/model") << "changed";
  EXPECT_EQ(ReadText(two->path() + "/deep/model"), "text {a}") << "copied, not linked";
  ASSERT_TRUE((*scratch)->WriteTemplates(files, {{"a", "2"}}, one->path(), {}).ok());
  EXPECT_EQ(ReadText(one->path() + "/in"), "v = 2, ${a}");
}

TEST(Scratch, NamesThatLeaveTheFolderAreRefused) {
  for (const char* name :
       {"", "/etc/passwd", "..", "../a", "a/../../b", "a/..", "./a", "a//b", "a/"}) {
    const absl::Status status = CheckFileName(name);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << name;
  }
  for (const char* name : {"a", "a/b.txt", "..a", "a..", "...", ".hidden"}) {
    EXPECT_TRUE(CheckFileName(name).ok()) << name;
  }
  const TemporaryFolder folder;
  Contents contents;
  const auto scratch = Scratch::Open(folder.path() + "/s", contents.AsFetch());
  const auto run = (*scratch)->MakeRunFolder();
  const std::string digest = contents.Add("x");
  const auto refused = [&](const Scratch::Files& files) {
    return (*scratch)->CopyFiles(files, run->path(), {}).code() ==
           absl::StatusCode::kInvalidArgument;
  };
  EXPECT_TRUE(refused(Listed("../x", digest)));
  EXPECT_TRUE(refused(Listed("request.json", digest)));
  Scratch::Files twice = Listed("x", digest);
  *twice.Add() = twice[0];
  EXPECT_TRUE(refused(twice));
  twice[1].set_name("x/y");
  EXPECT_TRUE(refused(twice));
  EXPECT_EQ(contents.fetches(), 0);
}

TEST(Scratch, ContentOfAnotherDigestIsRefusedAndAFailureIsNotRemembered) {
  const TemporaryFolder folder;
  Contents contents;
  const std::string digest = contents.Add("right");
  int fetches = 0;
  const auto scratch =
      Scratch::Open(folder.path() + "/s",
                    [&](const std::string&, std::stop_token) -> absl::StatusOr<std::string> {
                      ++fetches;
                      if (fetches == 1) return absl::UnavailableError("no server");
                      return fetches == 2 ? "wrong" : "right";
                    });
  const auto run = (*scratch)->MakeRunFolder();
  const auto copy = [&] { return (*scratch)->CopyFiles(Listed("x", digest), run->path(), {}); };
  EXPECT_EQ(copy().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(copy().code(), absl::StatusCode::kDataLoss);
  EXPECT_TRUE(copy().ok());
  EXPECT_EQ(ReadText(run->path() + "/x"), "right");
}

TEST(Scratch, SlotsShareOneFetchAndOneThatIsStoppedLeavesItToTheNext) {
  const TemporaryFolder folder;
  Contents contents;
  const std::string digest = contents.Add("x");
  std::atomic<int> begun = 0;
  std::atomic<bool> may_end = false;
  const auto scratch =
      Scratch::Open(folder.path() + "/s",
                    [&](const std::string&, std::stop_token stop) -> absl::StatusOr<std::string> {
                      ++begun;
                      while (!may_end && !stop.stop_requested()) std::this_thread::yield();
                      if (stop.stop_requested()) return absl::CancelledError("stopped");
                      return "x";
                    });
  std::vector<absl::Status> ended(4);
  std::vector<std::jthread> slots;
  for (absl::Status& status : ended) {
    slots.emplace_back([&](std::stop_token stop) {
      const auto run = (*scratch)->MakeRunFolder();
      status = (*scratch)->CopyFiles(Listed("x", digest), run->path(), stop);
    });
    while (begun == 0) std::this_thread::yield();  // the first one fetches
  }
  slots[0].request_stop();
  slots[0].join();
  slots[1].request_stop();
  slots[1].join();
  while (begun < 2) std::this_thread::yield();
  may_end = true;
  slots[2].join();  // its end would ask for a stop
  slots[3].join();
  EXPECT_EQ(ended[0].code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(ended[1].code(), absl::StatusCode::kCancelled);
  EXPECT_TRUE(ended[2].ok() && ended[3].ok()) << ended[2] << ended[3];
  EXPECT_LE(begun, 3);
}

TEST(Scratch, WhatWasUsedLongestAgoGivesWay) {
  const TemporaryFolder folder;
  Contents contents;
  const auto scratch = Scratch::Open(folder.path() + "/s", contents.AsFetch(), 25);
  const auto copy = [&](const char* content) {
    const auto run = (*scratch)->MakeRunFolder();
    const int before = contents.fetches();
    EXPECT_TRUE((*scratch)->CopyFiles(Listed("x", contents.Add(content)), run->path(), {}).ok());
    EXPECT_EQ(ReadText(run->path() + "/x"), content);
    return contents.fetches() > before;
  };
  EXPECT_TRUE(copy("0123456789"));
  EXPECT_TRUE(copy("abcdefghij"));
  EXPECT_FALSE(copy("0123456789"));
  EXPECT_TRUE(copy("ABCDEFGHIJ"));
  EXPECT_FALSE(copy("0123456789"));
  EXPECT_TRUE(copy("abcdefghij"));
  EXPECT_TRUE(copy(std::string(100, 'x').c_str())) << "one that is larger than the cache";
}

TEST(Scratch, CountsWhatIsOnDisk) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.path() + "/a/b");
  std::ofstream(folder.path() + "/a/b/c") << std::string(100'000, 'x');
  std::filesystem::create_directory_symlink("/", folder.path() + "/link");
  std::ofstream(folder.path() + "/hole") << "x";
  std::filesystem::resize_file(folder.path() + "/hole", 1'000'000'000);
  const double bytes = BytesBelow(folder.path());
  EXPECT_GE(bytes, 100'000);
  EXPECT_LT(bytes, 120'000);
}

TEST(Scratch, TheDefaultRootIsOfTheAccountAndTheName) {
  const std::string root = DefaultScratchRoot("node/1");
  EXPECT_NE(root.find("/calib-" + std::to_string(getuid()) + "-node_1"), std::string::npos);
}

}  // namespace
}  // namespace calib::worker
