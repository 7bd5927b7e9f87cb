// What leaves: at once for everybody, in pieces for the disk, and its room comes back.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "server/store/store.h"

namespace calib::store {
namespace {

constexpr std::int64_t kLater = 1'000'000'000'000;  // [s], after every put

class RemovalTest : public testing::Test {
 protected:
  void SetUp() override {
    path_ = testing::TempDir() + "/" +
            testing::UnitTest::GetInstance()->current_test_info()->name() + ".removal.db";
    for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path_ + suffix);
    Open();
  }
  void Open() {
    store_.reset();
    auto opened = Store::Open(path_);
    ASSERT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
  }
  void Write(const Store::Job& job) {
    const absl::Status status = store_->WriteNow(job);
    ASSERT_TRUE(status.ok()) << status;
  }
  Reader Read() { return *store_->Read(); }

  /// A finished campaign whose samples weigh more the larger their number is, with a file of its
  /// own.
  void AddCampaign(std::int64_t id, int samples = 10, int steps = 20) {
    const std::string digest = "file of " + std::to_string(id);
    Write([&](Transaction& t) {
      t.PutBlob(digest, std::string(10'000, 'x'));
      t.InsertCampaign({.id = id, .name = "sand", .yaml = "name: sand", .samples = samples},
                       {{"data.csv", digest}});
      t.InsertIteration(id, 0, "{}");
      for (int sample = 0; sample < samples; ++sample) {
        const EvaluationKey key{.campaign = id, .sample = sample, .experiment = 0};
        t.InsertSample(id, {.sample = sample, .parameters = {1e9}});
        t.InsertEvaluation({.key = key, .digest = "d" + std::to_string(sample)});
        t.InsertAttempt({.id = id * 1000 + sample, .key = key, .worker = "w"});
        t.EndAttempt({.id = id * 1000 + sample,
                      .outcome = AttemptOutcome::kCompleted,
                      .kept = {{.name = "log", .digest = digest}}});
        for (int step = 0; step < steps; ++step) {
          t.PutState({.key = key, .load_step = step, .observables = {1.0, 2.0}}, 0);
        }
        t.SetEvaluation(key, EvaluationStatus::kFinished, "", 0);
        t.SetWeight(id, sample, -10.0 + sample, 0);
      }
      t.SetProgress(id, {.state = CampaignState::kFinished});
      t.Log(id, 0, "finished");
    });
  }
  /// Until nothing leaves any more; how many transactions that took.
  int RemoveAll(int rows) {
    int pieces = 0;
    for (bool more = true; more; ++pieces) {
      Write([&](Transaction& t) {
        const Removed removed = t.Remove(rows);
        EXPECT_LE(removed.count, rows);
        more = removed.more;
      });
    }
    return pieces;
  }
  std::size_t StatesOf(std::int64_t campaign) { return Read().States(campaign)->size(); }

  std::string path_;
  std::unique_ptr<Store> store_;
};

TEST_F(RemovalTest, ADeletedCampaignIsGoneAtOnceAndLeavesInPieces) {
  AddCampaign(1);
  AddCampaign(2);
  ASSERT_EQ(Read().FindEqual("d3")->value().campaign, 1);
  Write([](Transaction& t) { t.DeleteCampaign(1); });
  EXPECT_TRUE(absl::IsNotFound(Read().Campaign(1).status()));
  ASSERT_EQ(Read().Campaigns()->size(), 1U);
  EXPECT_EQ(Read().Campaigns()->front().submitted.id, 2);
  EXPECT_EQ(Read().FindEqual("d3")->value().campaign, 2) << "what leaves is reused by nobody";
  EXPECT_EQ(*Read().LastCampaign(), 2);
  EXPECT_GT(RemoveAll(50), 4);
  EXPECT_EQ(StatesOf(1), 0U);
  EXPECT_EQ(StatesOf(2), 200U);
  EXPECT_TRUE(Read().Evaluations(1)->empty());
  EXPECT_TRUE(Read().Events(1)->empty());
  EXPECT_EQ(Read().UpkeepOf()->leaving, 0);
  Write([](Transaction& t) { EXPECT_EQ(t.Remove(50).count, 0); });
}

TEST_F(RemovalTest, GoesOnWhereTheProcessBeforeWasEnded) {
  AddCampaign(1);
  Write([](Transaction& t) { t.DeleteCampaign(1); });
  Write([](Transaction& t) { EXPECT_TRUE(t.Remove(70).more); });
  Open();
  EXPECT_TRUE(absl::IsNotFound(Read().Campaign(1).status()));
  EXPECT_EQ(Read().UpkeepOf()->leaving, 1);
  EXPECT_EQ(StatesOf(1), 130U);
  RemoveAll(70);
  EXPECT_EQ(StatesOf(1), 0U);
}

TEST_F(RemovalTest, PruningKeepsTheStatesOfTheSamplesThatWeighMost) {
  AddCampaign(1);
  bool is_less = false;
  const auto prune = [&](int kept) {
    Write([&](Transaction& t) { is_less = t.Prune(1, kept); });
    return is_less;
  };
  EXPECT_FALSE(prune(10)) << "it has no more";
  EXPECT_FALSE(Read().Campaign(1)->kept_states.has_value());
  EXPECT_TRUE(prune(3));
  EXPECT_FALSE(prune(5)) << "what has gone does not come back";
  EXPECT_EQ(Read().Campaign(1)->kept_states, 3);
  EXPECT_FALSE(Read().FindEqual("d9")->has_value()) << "nobody takes states that leave";
  EXPECT_TRUE(*Read().KeepsStates(1, 7));
  EXPECT_FALSE(*Read().KeepsStates(1, 6));
  const auto before = Read().EffortOf(1);
  RemoveAll(15);
  EXPECT_EQ(StatesOf(1), 60U);
  EXPECT_EQ(Read().States(1, 9)->size(), 20U);
  EXPECT_TRUE(Read().States(1, 6)->empty());
  EXPECT_EQ(Read().Evaluations(1)->size(), 10U);
  EXPECT_EQ(Read().EffortOf(1)->model_evaluations, before->model_evaluations);
  EXPECT_TRUE(prune(0));
  RemoveAll(15);
  EXPECT_EQ(StatesOf(1), 0U);
  Write([](Transaction& t) { t.DeleteCampaign(1); });
  RemoveAll(15);
  EXPECT_TRUE(Read().Evaluations(1)->empty());
}

TEST_F(RemovalTest, AContentGoesOnceNothingNamesIt) {
  AddCampaign(1);
  Write([](Transaction& t) { t.PutBlob("just put", "x"); });
  const auto unnamed = [this](std::int64_t put_before) {
    std::vector<std::string> digests;
    const auto found = Read().Unnamed(put_before, 100);
    for (const auto& [digest, bytes] : *found) digests.push_back(digest);
    return digests;
  };
  EXPECT_TRUE(unnamed(1).empty()) << "who puts a content names it soon";
  EXPECT_EQ(unnamed(kLater), std::vector<std::string>{"just put"});
  Write([](Transaction& t) {
    t.RemoveBlob("just put", 1);
    t.RemoveBlob("file of 1", kLater);
  });
  EXPECT_TRUE(*Read().HasBlob("just put"));
  EXPECT_TRUE(*Read().HasBlob("file of 1")) << "a campaign names it";
  Write([](Transaction& t) { t.DeleteCampaign(1); });
  RemoveAll(100);
  EXPECT_EQ(unnamed(1), std::vector<std::string>{"file of 1"}) << "it had its name";
  Write([](Transaction& t) { t.PutBlob("file of 1", std::string(10'000, 'x')); });
  EXPECT_TRUE(unnamed(1).empty()) << "somebody has put it again, to name it";
  Write([](Transaction& t) {
    t.RemoveBlob("just put", kLater);
    t.RemoveBlob("file of 1", kLater);
  });
  EXPECT_FALSE(*Read().HasBlob("just put"));
  EXPECT_FALSE(*Read().HasBlob("file of 1"));
}

TEST_F(RemovalTest, TheFileBecomesSmallerInPieces) {
  AddCampaign(1, 200, 200);
  AddCampaign(2);
  Open();  // all of it is in the file
  const std::int64_t before = store_->Numbers().file_bytes;
  Write([](Transaction& t) { t.DeleteCampaign(1); });
  RemoveAll(5000);
  int pieces = 0;
  for (bool more = true; more; ++pieces) {
    Write([&](Transaction& t) {
      const Removed pages = t.ReturnPages(100);
      EXPECT_LE(pages.count, 100);
      more = pages.more;
    });
  }
  EXPECT_GT(pieces, 2);
  EXPECT_EQ(Read().UpkeepOf()->empty_bytes, 0);
  EXPECT_LT(store_->Numbers().file_bytes, before / 4);
  EXPECT_EQ(StatesOf(2), 200U);
  EXPECT_EQ(Read().CheckFile(std::chrono::seconds(10))->fault, "");
}

TEST_F(RemovalTest, OneThatIsReusedFromMustStayWhole) {
  AddCampaign(1);
  AddCampaign(2);
  const EvaluationKey from{.campaign = 1, .sample = 0, .experiment = 0};
  const EvaluationKey to{.campaign = 2, .sample = 20, .experiment = 0};
  Write([&](Transaction& t) {
    t.InsertSample(2, {.sample = 20, .parameters = {1e9}});
    t.InsertEvaluation({.key = to, .digest = "d0"});
    t.Prune(1, 1);
    t.ReuseEvaluation(from, to);
  });
  EXPECT_TRUE(Read().States(2, 20)->empty());
  EXPECT_EQ(Read().Evaluations(2)->back().status, EvaluationStatus::kWaiting);
}

TEST_F(RemovalTest, WhatWasWrittenIsCounted) {
  AddCampaign(1);
  const StoreNumbers numbers = store_->Numbers();
  EXPECT_EQ(numbers.written.states, 200U);
  EXPECT_EQ(numbers.written.ended[static_cast<std::size_t>(AttemptOutcome::kCompleted)], 10U);
  std::uint64_t commits = 0;
  for (const std::uint64_t within : numbers.commits.within) commits += within;
  EXPECT_EQ(commits, 1U);
  EXPECT_GT(numbers.file_bytes + numbers.wal_bytes, 10'000);
}

}  // namespace
}  // namespace calib::store
