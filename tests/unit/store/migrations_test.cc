#include "server/store/migrations.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "server/store/connection.h"
#include "server/store/store.h"

namespace calib::store {
namespace {

std::string FreshFile(const std::string& name) {
  const std::string path = testing::TempDir() + "/" + name;
  for (const char* suffix : {"", "-wal", "-shm"}) {
    std::filesystem::remove(path + suffix);
  }
  return path;
}

/// A file as the program of schema `version` left it, with one campaign in it where there were any.
std::string FileOfVersion(int version) {
  const std::string path = FreshFile("version_" + std::to_string(version) + ".db");
  Connection connection(path, true);
  for (const Migration& migration : Migrations().first(static_cast<std::size_t>(version))) {
    connection.database().exec(migration.sql);
  }
  connection.database().exec("PRAGMA user_version=" + std::to_string(version));
  if (version >= 1) {
    connection.database().exec(
        "INSERT INTO campaign(name, yaml, file_name, method, samples, max_iterations, "
        "created_unix_ms, state) VALUES('sand', 'name: sand', 'sand.yaml', 'sqmc', 4, 1, 0, "
        "'finished')");
  }
  return path;
}

TEST(Migrations, AreNumberedFromOneWithoutGaps) {
  int expected = 0;
  for (const Migration& migration : Migrations()) {
    EXPECT_EQ(migration.number, ++expected) << migration.name;
  }
}

TEST(Migrations, FileOfEveryEarlierVersionOpensWithItsContent) {
  for (int version = 0; version <= static_cast<int>(Migrations().size()); ++version) {
    auto store = Store::Open(FileOfVersion(version));
    ASSERT_TRUE(store.ok()) << version << ": " << store.status();
    auto reader = (*store)->Read();
    ASSERT_TRUE(reader.ok()) << reader.status();
    const auto campaigns = reader->Campaigns();
    ASSERT_TRUE(campaigns.ok()) << campaigns.status();
    ASSERT_EQ(campaigns->size(), version >= 1 ? 1U : 0U);
    // Measurements of campaigns from before rules had a number are read by the first ones.
    if (version >= 1) {
      EXPECT_EQ(campaigns->front().submitted.reading_rules, 1);
    }
  }
}

TEST(Migrations, FileOfANewerProgramIsRefused) {
  const std::string path = FreshFile("newer.db");
  Connection(path, true).database().exec("PRAGMA user_version=1000");
  EXPECT_EQ(Store::Open(path).status().code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace calib::store
