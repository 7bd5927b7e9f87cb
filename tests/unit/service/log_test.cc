#include "server/service/upkeep/log.h"

#include <gmock/gmock.h>
#include <spdlog/formatter.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

namespace calib::service {
namespace {

nlohmann::json Formatted(const std::string& text) {
  const auto formatter = MakeJsonFormatter();
  spdlog::memory_buf_t line;
  formatter->format(spdlog::details::log_msg(spdlog::source_loc{}, "calibd", spdlog::level::warn,
                                             spdlog::string_view_t(text.data(), text.size())),
                    line);
  EXPECT_EQ(line[line.size() - 1], '\n');
  auto json = nlohmann::json::parse(line.begin(), line.end(), nullptr, false);
  EXPECT_TRUE(json.is_object()) << text;
  EXPECT_EQ(json["level"], "warning");
  json.erase("time");
  json.erase("level");
  return json;
}

using Json = nlohmann::json;

TEST(JsonLog, KeysBecomeFields) {
  EXPECT_EQ(Formatted("change what=submit of=c1 by=ann role=operator"),
            Json({{"event", "change"},
                  {"what", "submit"},
                  {"of", "c1"},
                  {"by", "ann"},
                  {"role", "operator"}}));
  EXPECT_EQ(
      Formatted("store_waits reason=\"the disk \"a=b\" is full\" free=\"0 MiB\""),
      Json({{"event", "store_waits"}, {"reason", "the disk \"a=b\" is full"}, {"free", "0 MiB"}}));
  EXPECT_EQ(Formatted("x empty= quoted=\"\""),
            Json({{"event", "x"}, {"empty", ""}, {"quoted", ""}}));
}

TEST(JsonLog, WhatIsNoFieldStaysAMessage) {
  for (const char* text : {"Nobody: has said so", "half quoted=\"abc", "a b=c d", "", "ev  a=b"}) {
    const Json json = Formatted(text);
    EXPECT_FALSE(json.contains("event") && *text != '\0') << json;
    EXPECT_EQ(json.value("message", ""), text);
  }
  EXPECT_EQ(Formatted("ev reason=\"\xff\n\"")["reason"], "\xef\xbf\xbd\n");
}

TEST(Log, AFileThatGrowsIsChangedAndIsItsOwnersAlone) {
  const std::string file = ::testing::TempDir() + "/calibd-rotates.log";
  for (const char* name : {"/calibd-rotates.log", "/calibd-rotates.1.log", "/calibd-rotates.2.log",
                           "/calibd-rotates.3.log"}) {
    std::filesystem::remove(::testing::TempDir() + name);
  }
  ASSERT_TRUE(StartLog(file, {.file_mib = 1, .files = 2}).ok());
  for (int k = 0; k < 45; ++k) spdlog::info("line k={} text=\"{}\"", k, std::string(100'000, 'x'));
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("none"));
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(::testing::TempDir())) {
    if (!entry.path().filename().string().starts_with("calibd-rotates")) continue;
    ++files;
    EXPECT_LE(entry.file_size(), std::uintmax_t{1} << 20) << entry.path();
    struct stat status = {};
    EXPECT_EQ(stat(entry.path().c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, 0600U) << entry.path();
  }
  EXPECT_EQ(files, 3);
  EXPECT_TRUE(absl::IsResourceExhausted(StartLog(file + "/none.log", {})));
}

}  // namespace
}  // namespace calib::service
