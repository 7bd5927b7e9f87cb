#include "server/store/migrations.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>
#include <thread>

#include "absl/strings/str_cat.h"
#include "server/store/connection.h"
#include "server/store/store.h"

namespace calib::store {
namespace {

std::string FreshFile(const std::string& name) {
  const std::string path = testing::TempDir() + "/" + name;
  for (const char* suffix : {"", "-wal", "-shm"}) {
    std::filesystem::remove(path + suffix);
  }
  std::filesystem::remove_all(path + ".before-" + std::to_string(Migrations().size()));
  return path;
}

/// Of a file of an earlier schema, named after it and this program's.
std::string CopyOf(const std::string& path) {
  return path + ".before-" + std::to_string(Migrations().size());
}

/// Names and states of the campaigns that a file of an earlier schema holds.
std::string CampaignsOf(const std::string& path) {
  SQLite::Database database(path, SQLite::OPEN_READONLY);
  return database.execAndGet("SELECT group_concat(name || ' ' || state) FROM campaign").getString();
}

int SchemaOf(const std::string& path) {
  SQLite::Database database(path, SQLite::OPEN_READONLY);
  return database.execAndGet("PRAGMA user_version").getInt();
}

std::string FileNameOf(int version) {
  return testing::TempDir() + "/version_" + std::to_string(version) + ".db";
}

/// A file as the program of schema `version` left it, with one campaign in it where there were any.
std::string FileOfVersion(int version) {
  const std::string path = FreshFile(std::filesystem::path(FileNameOf(version)).filename());
  Connection connection(path, true);
  for (const Migration& migration : Migrations().first(static_cast<std::size_t>(version))) {
    connection.database().exec(migration.sql);
  }
  connection.database().exec("PRAGMA user_version=" + std::to_string(version));
  if (version >= 1) {
    connection.database().exec(
        "INSERT INTO campaign(name, yaml, file_name, method, samples, max_iterations, "
        "created_unix_ms, state) VALUES('sand', 'name: sand', 'sand.yaml', 'sqmc', 4, 1, 0, "
        "'finished'); "
        "INSERT INTO iteration(campaign, number, proposal) VALUES(1, 0, '{}'); "
        "INSERT INTO sample(campaign, sample, iteration, parameters) VALUES(1, 3, 0, x'')");
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
    const std::string copy = CopyOf(FileNameOf(version));
    const bool is_earlier = version >= 1 && version < static_cast<int>(Migrations().size());
    ASSERT_EQ(std::filesystem::exists(copy), is_earlier) << copy;
    if (is_earlier) {
      EXPECT_EQ(SchemaOf(copy), version);
      EXPECT_EQ(CampaignsOf(copy), "sand finished");
      EXPECT_FALSE(std::filesystem::exists(copy + "-wal")) << "it is one file";
      struct stat file = {};
      ASSERT_EQ(stat(copy.c_str(), &file), 0);
      EXPECT_EQ(file.st_mode & 0777U, 0600U);
    }
    // Measurements of campaigns from before rules had a number are read by the first ones.
    if (version >= 1) {
      EXPECT_EQ(campaigns->front().submitted.reading_rules, 1);
      EXPECT_EQ(campaigns->front().submitted.owner, "");
      const auto samples = reader->Samples(1);  // and their samples have no stream of their own
      ASSERT_TRUE(samples.ok()) << samples.status();
      ASSERT_EQ(samples->size(), 1U);
      EXPECT_EQ(samples->front().sample, 3);
      EXPECT_FALSE(samples->front().stream.has_value());
    }
  }
}

TEST(Migrations, TheCopyOfAnInterruptedMigrationIsKept) {
  const std::string path = FileOfVersion(3);
  { ASSERT_TRUE(Store::Open(path).ok()); }
  const std::string copy = CopyOf(path);
  ASSERT_EQ(SchemaOf(copy), 3);
  // As a process that was killed between two steps has left the file.
  std::filesystem::copy_file(copy, path, std::filesystem::copy_options::overwrite_existing);
  {
    Connection half(path, true);
    half.database().exec(Migrations()[3].sql);
    half.database().exec("PRAGMA user_version=4");
  }
  ASSERT_TRUE(Store::Open(path).ok());
  EXPECT_EQ(SchemaOf(copy), 3) << "the state before its first step, not between two";
  // Put back and worked on by the program that wrote it, the file is another one.
  std::filesystem::copy_file(copy, path, std::filesystem::copy_options::overwrite_existing);
  Connection(path, true)
      .database()
      .exec(
          "INSERT INTO campaign(name, yaml, file_name, method, samples, max_iterations, "
          "created_unix_ms, state) VALUES('clay', 'name: clay', 'clay.yaml', 'sqmc', 4, 1, 0, "
          "'finished')");
  ASSERT_TRUE(Store::Open(path).ok());
  EXPECT_EQ(CampaignsOf(copy), "sand finished,clay finished");
}

TEST(Migrations, ADamagedCopyIsMadeAnewAndOneHalfWrittenIsNone) {
  const std::string path = FileOfVersion(2);
  std::ofstream(CopyOf(path)) << "no database";
  std::ofstream(CopyOf(path) + ".new") << "left by a process that was killed";
  ASSERT_TRUE(Store::Open(path).ok());
  EXPECT_EQ(SchemaOf(CopyOf(path)), 2);
  EXPECT_EQ(CampaignsOf(CopyOf(path)), "sand finished");
  EXPECT_FALSE(std::filesystem::exists(CopyOf(path) + ".new"));
}

TEST(Migrations, WithoutACopyNothingIsChanged) {
  const std::string path = FileOfVersion(2);
  std::filesystem::create_directories(CopyOf(path) + "/in the way");
  const absl::Status refused = Store::Open(path).status();
  EXPECT_FALSE(refused.ok());
  EXPECT_NE(std::string(refused.message()).find("nothing has been changed"), std::string::npos)
      << refused;
  EXPECT_EQ(SchemaOf(path), 2);
  EXPECT_EQ(CampaignsOf(path), "sand finished");
}

/// States in the file that is filled.
constexpr int kStates = 20'000;

/// FileOfVersion with states of one evaluation.
std::string FullFileOfVersion(int version) {
  const std::string path = FileOfVersion(version);
  Connection connection(path, true);
  connection.database().exec(absl::StrCat(
      "INSERT INTO evaluation(campaign, sample, experiment, status, digest) VALUES(1, 3, 0, "
      "'finished', 'd'); "
      "WITH RECURSIVE step(k) AS (SELECT 0 UNION ALL SELECT k + 1 FROM step WHERE k + 1 < ",
      kStates,
      ") INSERT INTO state(campaign, sample, experiment, load_step, observables) "
      "SELECT 1, 3, 0, k, zeroblob(64) FROM step"));
  return path;
}

/// A process of its own opens the file, and is killed after this while; whether it was through.
bool OpensBefore(const std::string& path, std::chrono::microseconds while_open) {
  const pid_t child = fork();
  if (child == 0) _exit(Store::Open(path).ok() ? 0 : 1);
  std::this_thread::sleep_for(while_open);
  kill(child, SIGKILL);
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status);
}

TEST(Migrations, KilledAtAnyMomentTheyGoOnWithEverything) {
  const int last = static_cast<int>(Migrations().size());
  std::mt19937 random(20261130);
  int killed = 0;
  int between = 0;  // of these, behind the first step and before the last
  for (int version = 1; version < last; ++version) {
    const auto begin = std::chrono::steady_clock::now();
    ASSERT_FALSE(OpensBefore(FullFileOfVersion(version), std::chrono::microseconds(0)));
    ASSERT_TRUE(Store::Open(FileNameOf(version)).ok());
    const auto whole = std::chrono::duration_cast<std::chrono::microseconds>(
        std::chrono::steady_clock::now() - begin);
    for (int round = 0; round < 6; ++round) {
      const std::string path = FullFileOfVersion(version);
      std::uniform_int_distribution<std::int64_t> moment(0, whole.count());
      if (OpensBefore(path, std::chrono::microseconds(moment(random)))) continue;
      ++killed;
      const int reached = SchemaOf(path);
      ASSERT_GE(reached, version);
      between += reached > version && reached < last ? 1 : 0;
      if (reached > version) {
        EXPECT_EQ(SchemaOf(CopyOf(path)), version) << "a copy comes first";
      }
      {
        auto store = Store::Open(path);
        ASSERT_TRUE(store.ok()) << version << " " << reached << ": " << store.status();
      }
      SQLite::Database file(path, SQLite::OPEN_READONLY);
      EXPECT_EQ(file.execAndGet("PRAGMA integrity_check").getString(), "ok");
      EXPECT_EQ(file.execAndGet("SELECT count(*) FROM state").getInt(), kStates);
      EXPECT_EQ(CampaignsOf(path), "sand finished");
    }
  }
  EXPECT_GT(killed, 6);
  std::cout << killed << " killed, " << between << " of them between two steps\n";
}

TEST(Migrations, FileOfANewerProgramIsRefused) {
  const std::string path = FreshFile("newer.db");
  Connection(path, true).database().exec("PRAGMA user_version=1000");
  EXPECT_EQ(Store::Open(path).status().code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace calib::store
