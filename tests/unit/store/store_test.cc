#include "server/store/store.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <span>

#include "absl/strings/str_cat.h"
#include "absl/synchronization/notification.h"

namespace calib::store {
namespace {

class StoreTest : public testing::Test {
 protected:
  void SetUp() override {
    path_ = testing::TempDir() + "/" +
            testing::UnitTest::GetInstance()->current_test_info()->name() + ".db";
    for (const char* suffix : {"", "-wal", "-shm"}) {
      std::filesystem::remove(path_ + suffix);
    }
    Open({});
  }

  void Open(StoreHooks hooks) {
    store_.reset();
    auto opened = Store::Open(path_, std::move(hooks));
    ASSERT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
  }

  void Write(const Store::Job& job) {
    const absl::Status status = store_->WriteNow(job);
    ASSERT_TRUE(status.ok()) << status;
  }

  Reader Read() {
    auto reader = store_->Read();
    EXPECT_TRUE(reader.ok()) << reader.status();
    return *std::move(reader);
  }

  /// One campaign, one iteration, one sample, one evaluation.
  static void PutEvaluation(Transaction& t) {
    t.InsertCampaign(
        {.id = 1, .name = "sand", .yaml = "name: sand", .method = "sqmc", .samples = 1}, {});
    t.InsertIteration(1, 0, "{}");
    t.InsertSample(1, {.sample = 0, .iteration = 0, .parameters = {1e9, 0.1}});
    t.InsertEvaluation({.key = kKey, .digest = "d"});
  }

  static constexpr EvaluationKey kKey{.campaign = 1, .sample = 0, .experiment = 0};
  std::string path_;
  std::unique_ptr<Store> store_;
};

TEST_F(StoreTest, CampaignComesBackAsSubmitted) {
  const NewCampaign campaign{.id = 7,
                             .name = "sand",
                             .yaml = "name: sand\n",
                             .file_name = "sand.yaml",
                             .seed = std::numeric_limits<std::uint64_t>::max(),
                             .method = "sqmc",
                             .samples = 10,
                             .max_iterations = 3,
                             .created_unix_ms = 1234,
                             .reading_rules = 5,
                             .owner = "ann"};
  Write([&](Transaction& t) {
    t.PutBlob("abc", std::string("\0grains\n", 8));
    t.InsertCampaign(campaign, {{"packing.txt", "abc"}});
    t.SetProgress(
        7,
        {.state = CampaignState::kPaused, .reason = "asked", .iteration = 2, .pause_waived = true});
    t.SetPriority(7, -3);
    t.Log(7, 99, "submitted");
  });
  Reader reader = Read();
  const auto record = reader.Campaign(7);
  ASSERT_TRUE(record.ok());
  EXPECT_EQ(record->priority, -3);
  EXPECT_EQ(record->submitted.seed, campaign.seed);
  EXPECT_EQ(record->submitted.yaml, campaign.yaml);
  EXPECT_EQ(record->submitted.reading_rules, 5);
  EXPECT_EQ(record->submitted.owner, "ann");
  EXPECT_EQ(record->progress.state, CampaignState::kPaused);
  EXPECT_TRUE(record->progress.pause_waived);
  EXPECT_EQ(reader.Files(7)->at("packing.txt"), "abc");
  EXPECT_EQ(*reader.Blob("abc"), std::string("\0grains\n", 8));
  EXPECT_EQ(reader.Events(7)->front().what, "submitted");
  EXPECT_EQ(reader.Campaign(8).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(*reader.LastCampaign(), 7);
}

TEST_F(StoreTest, QuotasAreReplacedAndTakenAway) {
  Write([](Transaction& t) {
    t.SetQuota("ann", 3);
    t.SetQuota("bob", 0);
    t.SetQuota("ann", 5);
  });
  EXPECT_EQ(*Read().Quotas(), (std::map<std::string, int>{{"ann", 5}, {"bob", 0}}));
  Write([](Transaction& t) {
    t.SetQuota("ann", std::nullopt);
    t.SetQuota("eve", std::nullopt);
  });
  EXPECT_EQ(*Read().Quotas(), (std::map<std::string, int>{{"bob", 0}}));
}

TEST_F(StoreTest, FilesOfAProgramStayWithTheirRunAndWithWhatReusesIt) {
  constexpr EvaluationKey kOther{.campaign = 1, .sample = 0, .experiment = 1};
  Write([&](Transaction& t) {
    PutEvaluation(t);
    t.InsertEvaluation({.key = kOther, .digest = "d"});
    t.PutBlob("abc", std::string("dump"));
    t.InsertAttempt({.id = 1, .key = kKey, .worker = "w"});
    t.EndAttempt({.id = 1,
                  .outcome = AttemptOutcome::kCompleted,
                  .kept = {{.name = "dump.vtk", .digest = "abc"},
                           {.name = "log", .reason = "is not there"},
                           {.name = "lost", .digest = "never put"}}});
    t.EndAttempt({.id = 77, .outcome = AttemptOutcome::kCompleted, .kept = {{.name = "x"}}});
    t.ReuseEvaluation(kKey, kOther);
  });
  const auto kept = Read().KeptBySample(1);
  ASSERT_TRUE(kept.ok()) << kept.status();
  ASSERT_EQ(kept->size(), 1U);
  const auto& files = kept->at(0);
  ASSERT_EQ(files.size(), 6U);
  for (std::size_t k = 0; k < files.size(); ++k) EXPECT_EQ(files[k].first, k < 3 ? 0 : 1);
  EXPECT_EQ(files[0].second.name, "dump.vtk");
  EXPECT_EQ(files[0].second.digest, "abc");
  EXPECT_EQ(files[1].second.reason, "is not there");
  EXPECT_EQ(files[2].second.digest, "") << "of a content that nobody has";
  Write([&](Transaction& t) { t.BeginAnew(kKey, "e"); });
  EXPECT_EQ(Read().KeptBySample(1)->at(0).size(), 3U);
  Write([&](Transaction& t) {
    t.DeleteCampaign(1);
    t.Remove(1000);
  });
  EXPECT_TRUE(Read().KeptBySample(1)->empty());
}

TEST_F(StoreTest, DoublesSurviveBitForBit) {
  const std::vector<double> values = {0.1, -0.0, 5e-324, 1.7976931348623157e308, 1.0 / 3.0};
  Write([&](Transaction& t) {
    PutEvaluation(t);
    t.PutState({.key = kKey, .load_step = 3, .observables = values}, 0);
    t.SetWeight(1, 0, -std::numeric_limits<double>::infinity(), std::nan(""));
  });
  Reader reader = Read();
  const auto states = reader.States(1);
  ASSERT_TRUE(states.ok());
  ASSERT_EQ(states->size(), 1U);
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(std::bit_cast<std::uint64_t>(states->front().observables[i]),
              std::bit_cast<std::uint64_t>(values[i]));
  }
  const auto samples = reader.Samples(1);
  EXPECT_EQ(samples->front().log_weight, -std::numeric_limits<double>::infinity());
  EXPECT_TRUE(std::isnan(samples->front().log_likelihood));
}

TEST_F(StoreTest, StatesAndEvaluationsOfSomeSamplesAlone) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    t.PutState({.key = kKey, .load_step = 0, .observables = {9}}, 0);
    for (const int sample : {1, 2, 3}) {
      const EvaluationKey key{.campaign = 1, .sample = sample, .experiment = 0};
      t.InsertSample(1, {.sample = sample, .iteration = 0, .parameters = {1e9, 0.2}});
      t.InsertEvaluation({.key = key, .digest = "d"});
      for (const int step : {1, 0}) {
        t.PutState({.key = key, .load_step = step, .observables = {0.5 + sample, 0.25 * step}}, 0);
      }
    }
    t.SetEvaluation({1, 1, 0}, EvaluationStatus::kUnknown, "no", 3);
    t.InsertEvaluation({.key = {1, 1, 1}, .digest = "e"});
    t.SetRest({1, 2, 0}, 1);
  });
  Reader reader = Read();
  std::vector<std::vector<double>> seen;
  const auto see = [&](const EvaluationKey& key, int step, std::span<const double> observables) {
    seen.push_back({static_cast<double>(key.campaign), static_cast<double>(key.sample),
                    static_cast<double>(key.experiment), static_cast<double>(step)});
    seen.back().insert(seen.back().end(), observables.begin(), observables.end());
  };
  ASSERT_TRUE(reader.EachState(1, 1, 2, see).ok());
  const std::vector<std::vector<double>> expected = {
      {1, 1, 0, 0, 1.5, 0}, {1, 1, 0, 1, 1.5, 0.25}, {1, 2, 0, 0, 2.5, 0}, {1, 2, 0, 1, 2.5, 0.25}};
  EXPECT_EQ(seen, expected);
  seen.clear();
  ASSERT_TRUE(reader.EachState(2, 0, 9, see).ok());
  EXPECT_TRUE(seen.empty());
  std::string statuses;
  ASSERT_TRUE(reader
                  .EachStatus(1, 1, 2,
                              [&](int sample, EvaluationStatus status, bool rests) {
                                absl::StrAppend(&statuses, sample, " ", ToString(status),
                                                rests ? " rests, " : ", ");
                              })
                  .ok());
  EXPECT_EQ(statuses, "1 unknown, 1 waiting, 2 waiting rests, ");
  ASSERT_EQ(reader.Evaluations(1)->size(), 5U);
  ASSERT_EQ(reader.Evaluations(1, 2)->size(), 2U);
  EXPECT_EQ(reader.Evaluations(1, 2)->front().key.sample, 2);
}

TEST_F(StoreTest, AStreamOfItsOwnComesBackAndNoneStaysNone) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    t.InsertSample(1, {.sample = 1, .iteration = 0, .parameters = {1e9, 0.2}, .stream = 0});
    t.InsertSample(1, {.sample = 2, .iteration = 0, .parameters = {1e9, 0.3}, .stream = 1'000'000});
  });
  Reader reader = Read();
  const auto samples = reader.Samples(1);
  ASSERT_TRUE(samples.ok()) << samples.status();
  ASSERT_EQ(samples->size(), 3U);
  EXPECT_FALSE((*samples)[0].stream.has_value());
  EXPECT_EQ((*samples)[1].stream, 0);
  EXPECT_EQ((*samples)[2].stream, 1'000'000);
}

TEST_F(StoreTest, StateThatArrivesTwiceIsHarmlessAndOtherBitsAreLogged) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    t.PutState({.key = kKey, .load_step = 0, .observables = {1.0}}, 10);
    t.PutState({.key = kKey, .load_step = 0, .observables = {1.0}}, 11);
  });
  EXPECT_TRUE(Read().Events(1)->empty());
  Write([](Transaction& t) {
    t.PutState({.key = kKey, .load_step = 0, .observables = {1.0000000000000002}}, 12);
  });
  Reader reader = Read();
  EXPECT_EQ(reader.States(1)->front().observables.front(), 1.0);
  ASSERT_EQ(reader.Events(1)->size(), 1U);
  EXPECT_NE(reader.Events(1)->front().what.find("nondeterminism"), std::string::npos);
}

TEST_F(StoreTest, WhatAProgramTellsBesidesAStateJoinsIt) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    t.PutState({.key = kKey, .load_step = 0, .observables = {1.0}, .others = R"({"grains":10})"},
               10);
    t.PutState({.key = kKey, .load_step = 0, .others = R"({"energy":0.5})"}, 11);
  });
  Reader reader = Read();
  EXPECT_TRUE(reader.Events(1)->empty());
  ASSERT_EQ(reader.States(1)->size(), 1U);
  EXPECT_EQ(reader.States(1)->front().observables, std::vector<double>{1.0});
  EXPECT_EQ(reader.States(1)->front().others, R"({"grains":10,"energy":0.5})");
}

TEST_F(StoreTest, AForgottenRequestIsNewAgain) {
  const RequestRecord one{.digest = "d", .answer = "c1"};
  Write([&](Transaction& t) {
    t.PutRequest("r1", one);
    t.PutRequest("r2", {.digest = "d", .answer = "c2"});
  });
  ASSERT_TRUE(Read().Request("r1")->has_value());
  Write([](Transaction& t) { t.ForgetRequests("c1"); });
  EXPECT_FALSE(Read().Request("r1")->has_value());
  EXPECT_TRUE(Read().Request("r2")->has_value());
  Write([&](Transaction& t) { t.PutRequest("r1", one); });
  EXPECT_TRUE(Read().Request("r1")->has_value());
}

TEST_F(StoreTest, AttemptNumbersAreNeverUsedAgain) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    t.InsertAttempt({.id = 5, .key = kKey, .worker = "w"});
  });
  EXPECT_EQ(Read().ActiveAttempts()->size(), 1U);
  Write([](Transaction& t) {
    t.EndAttempt({.id = 5, .outcome = AttemptOutcome::kCompleted, .core_seconds = 2.5});
    t.SetEvaluation(kKey, EvaluationStatus::kFinished, "", 0);
  });
  EXPECT_TRUE(Read().ActiveAttempts()->empty());
  EXPECT_EQ(Read().EffortOf(1)->model_evaluations, 1);
  EXPECT_EQ(Read().EffortOf(1)->core_seconds, 2.5);
  Write([](Transaction& t) {
    t.DeleteCampaign(1);
    t.Remove(1000);
  });
  EXPECT_EQ(*Read().LastAttempt(), 5);
  EXPECT_EQ(*Read().LastCampaign(), 1);
  EXPECT_TRUE(Read().States(1)->empty());
}

TEST_F(StoreTest, EqualEvaluationIsReusedWithItsStates) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    t.PutState({.key = kKey, .load_step = 0, .observables = {4.0}}, 0);
  });
  EXPECT_FALSE(Read().FindEqual("d")->has_value()) << "it has not ended yet";
  const EvaluationKey copy{.campaign = 1, .sample = 1, .experiment = 0};
  Write([&](Transaction& t) {
    t.SetEvaluation(kKey, EvaluationStatus::kDiverged, "lost grains", 0);
    t.InsertSample(1, {.sample = 1, .iteration = 0, .parameters = {1e9, 0.1}});
    t.InsertEvaluation({.key = copy, .digest = "d"});
    t.ReuseEvaluation(kKey, copy);
  });
  EXPECT_EQ(*Read().FindEqual("d"), kKey);
  const auto evaluations = Read().Evaluations(1);
  EXPECT_EQ(evaluations->at(1).status, EvaluationStatus::kDiverged);
  EXPECT_EQ(evaluations->at(1).reason, "lost grains");
  EXPECT_TRUE(evaluations->at(1).reused);
  EXPECT_EQ(Read().States(1, 1)->front().observables.front(), 4.0);
  EXPECT_EQ(Read().EffortOf(1)->model_evaluations, 1) << "counted once";
}

TEST_F(StoreTest, WhatAnEvaluationCostIsThatOfItsAttemptsOrOfTheRunThatItReuses) {
  const EvaluationKey copy{.campaign = 1, .sample = 1, .experiment = 0};
  Write([&](Transaction& t) {
    PutEvaluation(t);
    for (const int id : {5, 6}) {
      t.InsertAttempt({.id = id, .key = kKey, .worker = "w"});
      t.EndAttempt({.id = id,
                    .outcome = id == 5 ? AttemptOutcome::kLost : AttemptOutcome::kCompleted,
                    .core_seconds = 1.5});
    }
    t.SetEvaluation(kKey, EvaluationStatus::kFinished, "", 0);
    t.InsertSample(1, {.sample = 1, .iteration = 0, .parameters = {1e9, 0.1}});
    t.InsertEvaluation({.key = copy, .digest = "d"});
  });
  EXPECT_EQ(Read().CoreSeconds(1)->at(kKey), 3);
  EXPECT_FALSE(Read().CoreSeconds(1)->contains(copy)) << "it has neither run nor been reused";
  Write([&](Transaction& t) { t.ReuseEvaluation(kKey, copy); });
  EXPECT_EQ(Read().CoreSeconds(1)->at(copy), 3);
  EXPECT_EQ(Read().CoreSeconds(1)->at(kKey), 3);
}

TEST_F(StoreTest, FailedCommitIsReportedToEveryoneAndNothingMoreIsTaken) {
  bool broken = false;
  Open({.before_commit = [&] {
    return broken ? absl::PermissionDeniedError("disk I/O error") : absl::OkStatus();
  }});
  Write([](Transaction& t) { PutEvaluation(t); });
  broken = true;
  EXPECT_EQ(store_->WriteNow([](Transaction& t) { t.Log(1, 0, "lost"); }).code(),
            absl::StatusCode::kPermissionDenied);
  broken = false;
  EXPECT_EQ(store_->WriteNow([](Transaction& t) { t.Log(1, 0, "also lost"); }).code(),
            absl::StatusCode::kPermissionDenied);
  Open({});
  EXPECT_TRUE(Read().Events(1)->empty());
  EXPECT_EQ(Read().Evaluations(1)->size(), 1U) << "what was acknowledged is there";
}

TEST_F(StoreTest, WriteThatBreaksAConstraintIsRolledBackAlone) {
  Write([](Transaction& t) { PutEvaluation(t); });
  // All three wait while the first commit is held up, and go into one.
  absl::Notification held;
  Open({.before_commit = [&held] {
    held.WaitForNotification();
    return absl::OkStatus();
  }});
  std::array<absl::Status, 4> statuses;
  const auto write = [&](std::size_t k, const Store::Job& job) {
    store_->Write(job, [&statuses, k](const absl::Status& status) { statuses[k] = status; });
  };
  write(0, [](Transaction& t) { t.Log(1, 0, "holds the group together"); });
  write(1, [](Transaction& t) { t.Log(1, 0, "before"); });
  write(2, [](Transaction& t) {
    t.Log(1, 0, "with the bad row");
    t.InsertEvaluation({.key = {.campaign = 99, .sample = 0, .experiment = 0}, .digest = "x"});
  });
  write(3, [](Transaction& t) { t.Log(1, 0, "after"); });
  held.Notify();
  Open({});
  EXPECT_TRUE(statuses[1].ok()) << statuses[1];
  EXPECT_EQ(statuses[2].code(), absl::StatusCode::kInvalidArgument) << statuses[2];
  EXPECT_TRUE(statuses[3].ok()) << statuses[3];
  const auto events = *Read().Events(1);
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[1].what, "before");
  EXPECT_EQ(events[2].what, "after");
  EXPECT_EQ(Read().Evaluations(1)->size(), 1U);
}

TEST_F(StoreTest, ACoreTimeThatIsNoNumberIsRefusedAndOneThatIsNoTimeIsNotCounted) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    for (const int id : {5, 6}) t.InsertAttempt({.id = id, .key = kKey, .worker = "w"});
    t.EndAttempt({.id = 6, .core_seconds = std::numeric_limits<double>::infinity()});
  });
  const auto end = [](Transaction& t) {
    t.EndAttempt({.id = 5, .core_seconds = std::numeric_limits<double>::quiet_NaN()});
  };
  EXPECT_EQ(store_->WriteNow(end).code(), absl::StatusCode::kInvalidArgument);
  Write([](Transaction& t) { t.EndAttempt({.id = 5, .core_seconds = 2}); });
  EXPECT_EQ(Read().EffortOf(1)->core_seconds, 2);
}

TEST_F(StoreTest, OpenAttemptsOfACampaignEndTogetherAndThoseThatHaveEndedStay) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    for (const int id : {5, 6}) t.InsertAttempt({.id = id, .key = kKey, .worker = "w"});
    t.EndAttempt({.id = 5, .outcome = AttemptOutcome::kCompleted, .core_seconds = 1});
    t.EndOpenAttempts(1, {.outcome = AttemptOutcome::kStopped, .reason = "again"});
  });
  EXPECT_TRUE(Read().ActiveAttempts()->empty());
  EXPECT_EQ(Read().EffortOf(1)->core_seconds, 1);
}

TEST_F(StoreTest, ContentsAreWrittenAndReadInPieces) {
  std::string content(1'300'001, '\0');
  for (std::size_t k = 0; k < content.size(); ++k) content[k] = static_cast<char>(k * k % 251);
  std::size_t largest = 0;
  const auto bytes = static_cast<std::int64_t>(content.size());
  const auto piece = [&](std::int64_t from, std::span<char> to) {
    largest = std::max(largest, to.size());
    content.copy(to.data(), to.size(), static_cast<std::size_t>(from));
    return true;
  };
  Write([&](Transaction& t) {
    t.PutBlob("large", bytes, piece);
    t.PutBlob("empty", 0, piece);
  });
  Write([&](Transaction& t) { t.PutBlob("large", bytes, piece); });
  EXPECT_LT(largest, content.size() / 2) << "it is never whole in memory";
  Reader reader = Read();
  EXPECT_EQ(*reader.Blob("large"), content);
  EXPECT_EQ(*reader.Blob("empty"), "");
  EXPECT_EQ(*reader.BlobBytes("large"), bytes);
  EXPECT_EQ(*reader.BlobPiece("large", 1'000'000, 100), content.substr(1'000'000, 100));
  EXPECT_EQ(*reader.BlobPiece("large", 1'300'000, 100), content.substr(1'300'000));
  EXPECT_EQ(*reader.BlobPiece("large", bytes, 100), "");
  EXPECT_EQ(reader.BlobPiece("other", 0, 1).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(reader.BlobBytes("other").status().code(), absl::StatusCode::kNotFound);
  const auto torn = [&](Transaction& t) {
    t.PutBlob("torn", bytes, [](std::int64_t from, std::span<char>) { return from == 0; });
  };
  EXPECT_EQ(store_->WriteNow(torn).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_FALSE(*Read().HasBlob("torn"));
}

TEST_F(StoreTest, AReaderSeesOneMomentOnly) {
  Write([](Transaction& t) { PutEvaluation(t); });
  Reader reader = Read();
  EXPECT_EQ(reader.Campaigns()->size(), 1U);
  Write([](Transaction& t) {
    t.InsertCampaign({.id = 2, .name = "clay", .method = "sqmc", .samples = 1}, {});
  });
  EXPECT_EQ(reader.Campaigns()->size(), 1U);
  EXPECT_EQ(Read().Campaigns()->size(), 2U);
}

// A document that is not there, or a campaign that is gone, must not break the commit they share.
TEST_F(StoreTest, FindingsAreKeptOnceAndGoWithTheirCampaign) {
  Write([&](Transaction& t) {
    PutEvaluation(t);
    t.PutBlob("abc", "{}");
    t.PutFinding(1, {.kind = "diagnosis", .digest = "abc", .created_unix_ms = 5});
    t.PutFinding(1, {.kind = "diagnosis", .digest = "abc", .created_unix_ms = 6});
    t.PutFinding(1, {.kind = "improvement", .digest = "abc", .created_unix_ms = 7});
    t.PutFinding(1, {.kind = "diagnosis", .digest = "never put", .created_unix_ms = 8});
    t.PutFinding(9, {.kind = "diagnosis", .digest = "abc", .created_unix_ms = 9});
  });
  const auto findings = Read().Findings(1);
  ASSERT_TRUE(findings.ok()) << findings.status();
  ASSERT_EQ(findings->size(), 2U);
  EXPECT_EQ((*findings)[0].kind, "diagnosis");
  EXPECT_EQ((*findings)[0].created_unix_ms, 5);
  EXPECT_EQ((*findings)[1].kind, "improvement");
  Write([](Transaction& t) {
    t.DeleteCampaign(1);
    t.Remove(1000);
  });
  EXPECT_TRUE(Read().Findings(1)->empty());
}

TEST_F(StoreTest, AFindingThatIsPutAgainIsTheLast) {
  Write([&](Transaction& t) {
    PutEvaluation(t);
    t.PutBlob("all", "{}");
    t.PutBlob("fewer", "{}");
    t.PutFinding(1, {.kind = "diagnosis", .digest = "all", .created_unix_ms = 5});
    t.PutFinding(1, {.kind = "diagnosis", .digest = "fewer", .created_unix_ms = 6});
  });
  EXPECT_EQ(Read().Findings(1)->back().digest, "fewer");
  Write([](Transaction& t) {
    t.PutFinding(1, {.kind = "diagnosis", .digest = "all", .created_unix_ms = 7});
    t.PutFinding(1, {.kind = "diagnosis", .digest = "all", .created_unix_ms = 8});
  });
  const auto findings = Read().Findings(1);
  ASSERT_EQ(findings->size(), 2U);
  EXPECT_EQ(findings->front().digest, "fewer");
  EXPECT_EQ(findings->back().digest, "all");
  EXPECT_EQ(findings->back().created_unix_ms, 5) << "when it was concluded first";
}

TEST_F(StoreTest, AFileIsLookedThroughAndItsDamageFound) {
  Write([](Transaction& t) {
    PutEvaluation(t);
    for (int i = 0; i < 200; ++i) {
      t.PutBlob("digest" + std::to_string(i), std::string(4000, 'b'));
    }
  });
  const auto whole = Read().CheckFile(std::chrono::seconds(10));
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_TRUE(whole->in_full);
  EXPECT_EQ(whole->fault, "");

  store_.reset();  // everything is in the file now
  const auto size = std::filesystem::file_size(path_);
  {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(size / 2));
    file << std::string(size / 4, 'x');
  }
  Open({});
  const auto damaged = Read().CheckFile(std::chrono::seconds(10));
  EXPECT_TRUE(!damaged.ok() || !damaged->fault.empty());
}

}  // namespace
}  // namespace calib::store
