#include "worker/engine/resting_run.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "dem/model/state.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/model/sha256.h"
#include "server/messages/attempt_spec.h"
#include "server/methods/registry.h"
#include "tests/support/small_campaign.h"
#include "worker/engine/evaluate.h"

namespace calib::worker {
namespace {

constexpr int kLoadSteps = 6;

class RestingRun : public ::testing::Test {
 protected:
  RestingRun()
      : campaign_(calib::testing::MakeSmallCampaign({.load_steps = kLoadSteps})),
        specimens_([this](const std::string& digest,
                          std::stop_token /*stop*/) -> absl::StatusOr<std::string> {
          for (const auto& [path, content] : campaign_.files) {
            if (campaign::Sha256Hex(content) == digest) return content;
          }
          return absl::NotFoundError(digest);
        }) {
    const auto outcome =
        campaign::ReadCampaign(methods::All(), campaign_.yaml, "c.yaml",
                               [this](const std::string& path) -> absl::StatusOr<std::string> {
                                 return campaign_.files.at(path);
                               });
    EXPECT_TRUE(outcome.problems.empty());
    spec_ = messages::SpecOf(outcome.campaign, 0, {{2e8, 0.5}, 0});
    std::filesystem::remove_all(folder_);
  }

  Checkpoints Open(std::int64_t most_bytes = 1 << 30) const {
    auto opened = Checkpoints::Open(folder_, most_bytes);
    EXPECT_TRUE(opened.ok()) << opened.status();
    return *std::move(opened);
  }

  struct Outcome {
    v1::Finished finished;
    std::vector<dem::State> states;
  };

  Outcome RunTo(std::optional<int> rest_after, const Checkpoints* checkpoints) {
    Outcome outcome;
    outcome.finished = EvaluateToRung(
        spec_, {.run = "digest", .rest_after = rest_after, .leave = {}}, checkpoints, specimens_,
        [&outcome](const dem::State& state) { outcome.states.push_back(state); }, {});
    return outcome;
  }

  static void ExpectFirst(const std::vector<dem::State>& some, std::size_t count,
                          const std::vector<dem::State>& all) {
    ASSERT_EQ(some.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(some[i].load_step, all[i].load_step);
      EXPECT_EQ(some[i].values, all[i].values) << "the same bits at load step " << i;
    }
  }

  const calib::testing::SmallCampaign campaign_;
  Specimens specimens_;
  v1::AttemptSpec spec_;
  const std::string folder_ = ::testing::TempDir() + "/resting_run";
};

TEST_F(RestingRun, FromRungToRungToTheSameBitsInTheSameNumberOfSteps) {
  Outcome whole;
  whole.finished = Evaluate(
      spec_, specimens_, [&whole](const dem::State& state) { whole.states.push_back(state); }, {});
  ASSERT_EQ(whole.finished.outcome(), v1::Finished::OUTCOME_COMPLETED) << whole.finished.reason();
  const Checkpoints checkpoints = Open();
  std::int64_t steps = 0;
  std::int64_t updates = 0;
  for (const int rung : {1, 3}) {
    const Outcome part = RunTo(rung, &checkpoints);
    EXPECT_EQ(part.finished.outcome(), v1::Finished::OUTCOME_RESTING);
    EXPECT_EQ(part.finished.states(), rung + 1);
    ExpectFirst(part.states, static_cast<std::size_t>(rung) + 1, whole.states);
    EXPECT_GT(part.finished.steps(), 0);
    steps += part.finished.steps();
    updates += part.finished.contact_updates();
    EXPECT_TRUE(checkpoints.Find("digest").has_value());
  }
  // Asked for again, and for a rung it has passed: nothing is computed.
  for (const int rung : {3, 1}) {
    const Outcome again = RunTo(rung, &checkpoints);
    EXPECT_EQ(again.finished.outcome(), v1::Finished::OUTCOME_RESTING);
    EXPECT_EQ(again.finished.steps(), 0);
    ExpectFirst(again.states, static_cast<std::size_t>(rung) + 1, whole.states);
  }
  const Outcome rest = RunTo(std::nullopt, &checkpoints);
  EXPECT_EQ(rest.finished.outcome(), v1::Finished::OUTCOME_COMPLETED);
  ExpectFirst(rest.states, kLoadSteps, whole.states);
  EXPECT_EQ(steps + rest.finished.steps(), whole.finished.steps());
  EXPECT_EQ(updates + rest.finished.contact_updates(), whole.finished.contact_updates());
  EXPECT_FALSE(checkpoints.Find("digest").has_value()) << "nobody goes on from there any more";
}

TEST_F(RestingRun, GoesOnElsewhereFromWhereItHadToLeave) {
  const Outcome whole = RunTo(std::nullopt, nullptr);
  ASSERT_EQ(whole.finished.outcome(), v1::Finished::OUTCOME_COMPLETED) << whole.finished.reason();
  const Checkpoints checkpoints = Open();
  std::stop_source leave;
  std::vector<dem::State> states;
  const v1::Finished left =
      EvaluateToRung(spec_, {.run = "digest", .rest_after = {}, .leave = leave.get_token()},
                     &checkpoints, specimens_,
                     [&](const dem::State& state) {
                       states.push_back(state);
                       if (state.load_step == 2) leave.request_stop();
                     },
                     {});
  EXPECT_EQ(left.outcome(), v1::Finished::OUTCOME_STOPPED);
  EXPECT_EQ(states.size(), 3U);
  ASSERT_TRUE(checkpoints.Find("digest").has_value());
  const Outcome rest = RunTo(std::nullopt, &checkpoints);
  EXPECT_EQ(rest.finished.outcome(), v1::Finished::OUTCOME_COMPLETED);
  ExpectFirst(rest.states, kLoadSteps, whole.states);
  EXPECT_LT(rest.finished.steps(), whole.finished.steps());
  EXPECT_EQ(left.steps() + rest.finished.steps(), whole.finished.steps());
  EXPECT_FALSE(checkpoints.Find("digest").has_value());
}

TEST_F(RestingRun, ThatIsNotWantedLeavesNothing) {
  const Checkpoints checkpoints = Open();
  std::stop_source stop;
  const v1::Finished stopped = EvaluateToRung(
      spec_, {.run = "digest", .rest_after = {}, .leave = {}}, &checkpoints, specimens_,
      [&](const dem::State& state) {
        if (state.load_step == 2) stop.request_stop();
      },
      stop.get_token());
  EXPECT_EQ(stopped.outcome(), v1::Finished::OUTCOME_STOPPED);
  EXPECT_FALSE(checkpoints.Find("digest").has_value());
}

TEST_F(RestingRun, WithoutACheckpointItBeginsAnewToTheSameBits) {
  const Checkpoints checkpoints = Open();
  const Outcome part = RunTo(2, &checkpoints);
  // Damaged in the middle: refused, not gone on from.
  const std::string path = folder_ + "/digest.checkpoint";
  std::string bytes;
  {
    std::ifstream file(path, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(file), {});
  }
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  std::ofstream(path, std::ios::binary) << bytes;
  const Outcome damaged = RunTo(4, &checkpoints);
  const Outcome none = RunTo(4, nullptr);
  EXPECT_EQ(damaged.finished.outcome(), v1::Finished::OUTCOME_RESTING);
  EXPECT_EQ(none.finished.outcome(), v1::Finished::OUTCOME_RESTING);
  EXPECT_EQ(damaged.finished.steps(), none.finished.steps());
  ExpectFirst(damaged.states, 5, none.states);
  ExpectFirst(part.states, 3, none.states);
}

TEST_F(RestingRun, TheFolderKeepsItsIdentityAndItsSize) {
  const Checkpoints first = Open();
  EXPECT_FALSE(first.identity().empty());
  EXPECT_EQ(Open().identity(), first.identity());
  const Checkpoints small = Open(2000);
  for (const char* run : {"a", "b", "c"}) {
    ASSERT_TRUE(small.Save(run, {.checkpoint = std::string(900, 'x')}).ok());
  }
  int kept = 0;
  for (const char* run : {"a", "b", "c"}) kept += small.Find(run).has_value() ? 1 : 0;
  EXPECT_EQ(kept, 2) << "the largest number that has room";
  EXPECT_TRUE(small.Find("c").has_value()) << "the last one";
  small.Remove("c");
  EXPECT_FALSE(small.Find("c").has_value());
}

TEST_F(RestingRun, WhatNobodyGoesOnFromIsNotKeptForEver) {
  ASSERT_TRUE(Open().Save("old", {.checkpoint = "x"}).ok());
  ASSERT_TRUE(Open().Save("new", {.checkpoint = "x"}).ok());
  for (const auto& file : std::filesystem::directory_iterator(folder_)) {
    if (file.path().filename().string().starts_with("old")) {
      std::filesystem::last_write_time(
          file, file.last_write_time() - Checkpoints::kLongestUnused - std::chrono::hours(1));
    }
  }
  const Checkpoints again = Open();
  EXPECT_FALSE(again.Find("old").has_value());
  EXPECT_TRUE(again.Find("new").has_value());
}

}  // namespace
}  // namespace calib::worker
