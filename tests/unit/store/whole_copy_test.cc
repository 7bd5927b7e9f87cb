// Copies of a store that goes on, and what is served in its place.
#include "server/store/whole_copy.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "server/store/store.h"

namespace calib::store {
namespace {

using ::testing::HasSubstr;

class WholeCopyTest : public testing::Test {
 protected:
  WholeCopyTest() {
    folder_ = testing::TempDir() + "/copy-" +
              testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    store_ = *Store::Open(folder_ + "/calib.db");
    Add(1);
  }
  void Add(std::int64_t id) {
    const absl::Status status = store_->WriteNow([id](Transaction& t) {
      t.InsertCampaign({.id = id, .name = "sand", .yaml = std::string(20'000, 'y')}, {});
      t.InsertIteration(id, 0, "{}");
      t.InsertSample(id, {.parameters = {1.0}});
      t.InsertEvaluation({.key = {.campaign = id}, .digest = "d"});
      t.InsertAttempt({.id = id * 10, .key = {.campaign = id}, .worker = "w"});
    });
    ASSERT_TRUE(status.ok()) << status;
  }
  std::string Copy() const { return folder_ + "/copy"; }

  std::string folder_;
  std::unique_ptr<Store> store_;
};

TEST_F(WholeCopyTest, HoldsOneMomentWhateverIsWrittenMeanwhile) {
  for (std::int64_t id = 2; id < 500; ++id) Add(id);
  std::int64_t next = 500;
  ASSERT_TRUE(store_->Read()
                  ->CopyTo(Copy(),
                           [&] {
                             Add(next++);
                             return true;
                           })
                  .ok());
  EXPECT_GT(next, 501) << "it was written to between its pieces";
  store_.reset();
  const auto copy = *Store::Open(Copy());
  EXPECT_EQ(copy->Read()->Campaigns()->size(), 499U);
  EXPECT_FALSE(std::filesystem::exists(Copy() + ".new"));
}

TEST_F(WholeCopyTest, OneThatIsNotToGoOnLeavesNothing) {
  for (std::int64_t id = 2; id < 500; ++id) Add(id);
  EXPECT_TRUE(absl::IsCancelled(store_->Read()->CopyTo(Copy(), [] { return false; })));
  EXPECT_FALSE(std::filesystem::exists(Copy()));
  EXPECT_FALSE(std::filesystem::exists(Copy() + ".new"));
}

TEST_F(WholeCopyTest, NumbersOfAttemptsGoOnFarAboveThoseOfTheOriginal) {
  ASSERT_TRUE(store_->Read()->CopyTo(Copy(), [] { return true; }).ok());
  const auto campaigns = MakeServable(Copy());
  ASSERT_TRUE(campaigns.ok()) << campaigns.status();
  EXPECT_EQ(*campaigns, 1);
  EXPECT_GE(*(*Store::Open(Copy()))->Read()->LastAttempt(), 1'000'000'010);
}

TEST_F(WholeCopyTest, WhatIsNoStateOrOfANewerProgramIsToldSo) {
  { std::ofstream(Copy()) << std::string(5000, 'x'); }
  EXPECT_THAT(std::string(MakeServable(Copy()).status().message()), HasSubstr("not a database"));
  std::filesystem::remove(Copy());
  {
    SQLite::Database(Copy(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
        .exec("CREATE TABLE t(i)");
  }
  EXPECT_TRUE(absl::IsDataLoss(MakeServable(Copy()).status()));
  std::filesystem::remove(Copy());
  ASSERT_TRUE(store_->Read()->CopyTo(Copy(), [] { return true; }).ok());
  { SQLite::Database(Copy(), SQLite::OPEN_READWRITE).exec("PRAGMA user_version=999"); }
  EXPECT_THAT(std::string(MakeServable(Copy()).status().message()), HasSubstr("newer program"));
}

}  // namespace
}  // namespace calib::store
