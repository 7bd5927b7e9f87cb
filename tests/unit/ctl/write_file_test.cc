#include "server/ctl/write_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "server/client/temporary_folder.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

std::string ContentOf(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

std::ptrdiff_t FilesIn(const std::string& folder) {
  return std::distance(std::filesystem::directory_iterator(folder),
                       std::filesystem::directory_iterator());
}

TEST(OutputFile, AnEarlierFileStaysUntilTheNewOneIsWhole) {
  const auto folder = client::TemporaryFolder::Make();
  ASSERT_TRUE(folder.ok());
  const std::string path = folder->path() + "/states.csv";
  ASSERT_TRUE(WriteFile(path, "old").ok());
  {
    const auto abandoned = OutputFile::Open(path);
    ASSERT_TRUE(abandoned.ok());
    EXPECT_EQ(ContentOf(path), "old");
  }
  EXPECT_EQ(ContentOf(path), "old");
  EXPECT_EQ(FilesIn(folder->path()), 1);
  auto file = OutputFile::Open(path);
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->Put("new").ok());
  EXPECT_EQ(ContentOf(path), "new");
  EXPECT_EQ(FilesIn(folder->path()), 1);
}

TEST(OutputFile, ALinkStaysALink) {
  const auto folder = client::TemporaryFolder::Make();
  ASSERT_TRUE(folder.ok());
  const std::string path = folder->path() + "/states.csv";
  ASSERT_TRUE(WriteFile(path, "old").ok());
  std::filesystem::create_symlink("states.csv", folder->path() + "/link");
  auto file = OutputFile::Open(folder->path() + "/link");
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->Put("new").ok());
  EXPECT_TRUE(std::filesystem::is_symlink(folder->path() + "/link"));
  EXPECT_EQ(ContentOf(path), "new");
}

TEST(OutputFile, WhereNothingCanBeWrittenIsKnownAtOnce) {
  const auto folder = client::TemporaryFolder::Make();
  ASSERT_TRUE(folder.ok());
  const std::string missing = folder->path() + "/none/states.csv";
  EXPECT_THAT(std::string(OutputFile::Open(missing).status().message()),
              HasSubstr(missing + " cannot be written: No such file or directory"));
  EXPECT_THAT(std::string(OutputFile::Open(folder->path()).status().message()),
              HasSubstr(" cannot be written: is a folder"));
}

TEST(OutputFile, ADeviceIsWrittenToItself) {
  auto file = OutputFile::Open("/dev/full");
  ASSERT_TRUE(file.ok());
  EXPECT_THAT(std::string(file->Put("text").message()), HasSubstr("/dev/full cannot be written"));
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

}  // namespace
}  // namespace calib::ctl
