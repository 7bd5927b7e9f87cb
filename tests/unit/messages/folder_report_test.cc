#include "server/messages/folder_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/process.h"

namespace calib::messages {
namespace {

using ::testing::HasSubstr;

TEST(FolderReport, WritesAndLeavesNothing) {
  const std::string folder = testing::FreshFolder("folder-report");
  const v1::FolderReport report = ExamineFolder(folder);
  EXPECT_EQ(report.path(), folder);
  EXPECT_EQ(report.problem(), "");
  EXPECT_FALSE(report.file_system().empty());
  EXPECT_GT(report.free_bytes(), 0);
  EXPECT_GE(report.total_bytes(), report.free_bytes());
  EXPECT_GT(report.sync_seconds(), 0);
  EXPECT_TRUE(std::filesystem::is_empty(folder));
}

TEST(FolderReport, WhatDoesNotExistIsExaminedWhereItWouldBe) {
  const std::string folder = testing::FreshFolder("folder-report-new");
  EXPECT_EQ(ExamineFolder(folder + "/a/b/").path(), folder);
  EXPECT_TRUE(std::filesystem::is_empty(folder));
}

TEST(FolderReport, SaysWhatCannotBeDone) {
  // Nobody makes files there, not even root.
  EXPECT_THAT(ExamineFolder("/proc").problem(), HasSubstr("no file can be made: "));
}

}  // namespace
}  // namespace calib::messages
