#include "worker/engine/engines.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>
#include <utility>
#include <vector>

#include "server/campaign/file/campaign_file.h"
#include "server/campaign/model/sha256.h"
#include "server/messages/attempt_spec.h"
#include "server/methods/registry.h"
#include "tests/support/small_campaign.h"
#include "worker/engine/evaluate.h"
#include "worker/program/process_tree.h"

namespace calib::worker {
namespace {

/// Children of this process.
std::vector<pid_t> Children() {
  std::vector<pid_t> children;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream file(thread.path() / "children");
    for (pid_t child = 0; file >> child;) children.push_back(child);
  }
  return children;
}

class EnginesOfAWorker : public ::testing::Test {
 protected:
  explicit EnginesOfAWorker(int load_steps = 6)
      : campaign_(calib::testing::MakeSmallCampaign({.load_steps = load_steps})),
        scratch_(::testing::TempDir() + "engines" + std::to_string(getpid())) {
    const auto outcome =
        campaign::ReadCampaign(methods::All(), campaign_.yaml, "c.yaml",
                               [this](const std::string& path) -> absl::StatusOr<std::string> {
                                 return campaign_.files.at(path);
                               });
    EXPECT_TRUE(outcome.problems.empty());
    *lease_.mutable_spec() = messages::SpecOf(outcome.campaign, 0, {{2e8, 0.5}, 0});
    lease_.set_attempt(1);
  }
  ~EnginesOfAWorker() override { std::filesystem::remove_all(scratch_); }

  absl::StatusOr<std::string> ContentOf(const std::string& digest) const {
    for (const auto& [path, content] : campaign_.files) {
      if (campaign::Sha256Hex(content) == digest) return content;
    }
    return absl::NotFoundError("no such content");
  }

  using States = std::vector<std::vector<double>>;

  /// The same run in this process.
  v1::Finished EvaluateHere(States& states) const {
    Specimens specimens(
        [this](const std::string& digest, std::stop_token /*stop*/) { return ContentOf(digest); });
    return Evaluate(lease_.spec(), specimens,
                    [&](const dem::State& state) { states.push_back(state.values); }, {});
  }

  EnginesOptions Options() const {
    return {.program = CALIB_WORKER,
            .fetch = [this](const std::string& digest,
                            std::stop_token /*stop*/) { return ContentOf(digest); },
            .scratch = scratch_,
            .checkpoints = {},
            .grace = std::chrono::milliseconds(300)};
  }

  /// Whose first engine stands still as soon as it asks for its specimen.
  EnginesOptions Stopping() {
    EnginesOptions options = Options();
    options.fetch = [this](const std::string& digest, std::stop_token /*stop*/) {
      if (!std::exchange(has_stopped_, true)) kill(Children().front(), SIGSTOP);
      return ContentOf(digest);
    };
    return options;
  }

  const calib::testing::SmallCampaign campaign_;
  const std::string scratch_;
  v1::Lease lease_;
  bool has_stopped_ = false;
};

TEST_F(EnginesOfAWorker, GiveTheBitsThatTheMechanicsGiveHere) {
  States here;
  const v1::Finished expected = EvaluateHere(here);
  Engines engines(Options());
  for (int run = 0; run < 2; ++run) {
    States there;
    const auto finished =
        engines.Evaluate(lease_,
                         [&](const v1::State& state) {
                           there.emplace_back(state.values().begin(), state.values().end());
                         },
                         {});
    EXPECT_EQ(finished.outcome(), v1::Finished::OUTCOME_COMPLETED) << finished.reason();
    EXPECT_EQ(there, here);
    EXPECT_EQ(finished.steps(), expected.steps());
    EXPECT_EQ(finished.states(), 6);
    EXPECT_GT(finished.core_seconds(), 0);
    EXPECT_EQ(Children().size(), 1U) << "the engine is kept for the next run";
  }
}

TEST_F(EnginesOfAWorker, MakeTheSamePackingOfARecipe) {
  v1::PackingRecipe& recipe = *lease_.mutable_spec()->mutable_recipe();
  recipe.set_particles(60);
  recipe.set_porosity(0.42);
  recipe.set_mean_radius(1e-3);
  recipe.set_radius_spread(0.2);
  recipe.set_aspect(1);
  recipe.set_pressure(1e4);
  recipe.set_seed(3);
  States here;
  const v1::Finished expected = EvaluateHere(here);
  ASSERT_EQ(expected.outcome(), v1::Finished::OUTCOME_COMPLETED) << expected.reason();
  Engines engines(Options());
  std::vector<std::jthread> slots;
  for (int slot = 0; slot < 2; ++slot) {
    slots.emplace_back([&] {
      States there;
      const auto finished =
          engines.Evaluate(lease_,
                           [&](const v1::State& state) {
                             there.emplace_back(state.values().begin(), state.values().end());
                           },
                           {});
      EXPECT_EQ(finished.outcome(), v1::Finished::OUTCOME_COMPLETED) << finished.reason();
      EXPECT_EQ(there, here);
    });
  }
}

TEST_F(EnginesOfAWorker, ThatDiesEndsItsOwnRunAlone) {
  Engines engines(Options());
  const auto died = engines.Evaluate(
      lease_, [](const v1::State& /*state*/) { kill(Children().front(), SIGSEGV); }, {});
  EXPECT_EQ(died.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_NE(died.reason().find("the engine ended by SIGSEGV after "), std::string::npos)
      << died.reason();
  const auto next = engines.Evaluate(lease_, [](const v1::State& /*state*/) {}, {});
  EXPECT_EQ(next.outcome(), v1::Finished::OUTCOME_COMPLETED) << next.reason();
}

TEST_F(EnginesOfAWorker, ThatDiedWhileItWaitedIsReplaced) {
  Engines engines(Options());
  const auto ignore = [](const v1::State& /*state*/) {};
  EXPECT_EQ(engines.Evaluate(lease_, ignore, {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
  kill(Children().front(), SIGKILL);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(engines.Evaluate(lease_, ignore, {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
}

// Less than any engine has.
TEST_F(EnginesOfAWorker, ThatTakeMoreMemoryThanTheyMayAreKilledAlone) {
  Engines engines(Stopping());
  const auto ignore = [](const v1::State& /*state*/) {};
  v1::Lease small = lease_;
  small.mutable_limits()->set_memory(1e6);
  const auto ended = engines.Evaluate(small, ignore, {});
  EXPECT_EQ(ended.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_NE(ended.reason().find("the engine came to its memory limit: "), std::string::npos)
      << ended.reason();
  EXPECT_NE(ended.reason().find(" of 1 MB, after "), std::string::npos) << ended.reason();
  EXPECT_TRUE(Children().empty());
  EXPECT_EQ(engines.Evaluate(lease_, ignore, {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
}

TEST_F(EnginesOfAWorker, ThatHangAreKilledAlone) {
  Engines engines(Stopping());
  const auto ignore = [](const v1::State& /*state*/) {};
  v1::Lease lease = lease_;
  lease.mutable_limits()->set_silence(0.5);
  const auto hangs = engines.Evaluate(lease, ignore, {});
  EXPECT_EQ(hangs.outcome(), v1::Finished::OUTCOME_MODEL_FAILED);
  EXPECT_NE(hangs.reason().find("the engine came to its silence limit: no state for 0.5 s, after"),
            std::string::npos)
      << hangs.reason();
  EXPECT_EQ(engines.Evaluate(lease_, ignore, {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
  kill(Children().front(), SIGSTOP);
  lease.mutable_limits()->clear_silence();
  lease.mutable_limits()->set_wall(0.5);
  const auto endless = engines.Evaluate(lease, ignore, {});
  EXPECT_NE(endless.reason().find("the engine came to its wall limit of 0.5 s, after"),
            std::string::npos)
      << endless.reason();
  EXPECT_TRUE(Children().empty());
}

// What earlier runs have left in an engine is not taken for the next one's.
TEST_F(EnginesOfAWorker, ThatIsHalfFullIsReplacedBeforeARunBegins) {
  Engines engines(Options());
  const auto ignore = [](const v1::State& /*state*/) {};
  EXPECT_EQ(engines.Evaluate(lease_, ignore, {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
  const pid_t first = Children().front();
  const double resident = LookAtTree(first).resident_bytes;
  ASSERT_GT(resident, 0);
  lease_.mutable_limits()->set_memory(10 * resident);
  EXPECT_EQ(engines.Evaluate(lease_, ignore, {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
  EXPECT_EQ(Children(), std::vector<pid_t>{first}) << "it has room enough";
  lease_.mutable_limits()->set_memory(1.6 * resident);
  EXPECT_EQ(engines.Evaluate(lease_, ignore, {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
  ASSERT_EQ(Children().size(), 1U);
  EXPECT_NE(Children().front(), first);
}

class EnginesOfALongRun : public EnginesOfAWorker {
 protected:
  EnginesOfALongRun() : EnginesOfAWorker(100) {}
};

TEST_F(EnginesOfALongRun, StopWhenTheyAreTold) {
  Engines engines(Options());
  std::stop_source stop;
  const auto finished = engines.Evaluate(
      lease_, [&](const v1::State& /*state*/) { stop.request_stop(); }, stop.get_token());
  EXPECT_EQ(finished.outcome(), v1::Finished::OUTCOME_STOPPED) << finished.reason();
  EXPECT_LT(finished.states(), 100);
  EXPECT_EQ(Children().size(), 1U) << "it is there for the next run";
}

TEST_F(EnginesOfALongRun, LeaveACheckpointWhereTheyHaveToGo) {
  EnginesOptions options = Options();
  options.checkpoints = scratch_ + "-checkpoints";
  lease_.set_run("digest");
  std::vector<std::string> whole;
  std::vector<std::string> again;
  const auto into = [](std::vector<std::string>& states) {
    return [&states](const v1::State& state) { states.push_back(state.SerializeAsString()); };
  };
  {
    Engines engines(Options());
    ASSERT_EQ(engines.Evaluate(lease_, into(whole), {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
  }
  std::stop_source leave;
  {
    Engines engines(options);
    const auto left = engines.Evaluate(
        lease_,
        [&](const v1::State& state) {
          if (state.load_step() == 4) leave.request_stop();
        },
        {}, leave.get_token());
    EXPECT_EQ(left.outcome(), v1::Finished::OUTCOME_STOPPED) << left.reason();
  }
  const std::filesystem::path kept = options.checkpoints + "/digest.checkpoint";
  EXPECT_TRUE(std::filesystem::exists(kept));
  {
    Engines engines(options);
    EXPECT_EQ(engines.Evaluate(lease_, into(again), {}).outcome(), v1::Finished::OUTCOME_COMPLETED);
  }
  EXPECT_EQ(again, whole);
  EXPECT_FALSE(std::filesystem::exists(kept));
  std::filesystem::remove_all(options.checkpoints);
}

TEST_F(EnginesOfALongRun, ThatDoNotHearAStopAreKilled) {
  Engines engines(Options());
  std::stop_source stop;
  const auto finished = engines.Evaluate(
      lease_,
      [&](const v1::State& /*state*/) {
        kill(Children().front(), SIGSTOP);
        stop.request_stop();
      },
      stop.get_token());
  EXPECT_EQ(finished.outcome(), v1::Finished::OUTCOME_STOPPED) << finished.reason();
  EXPECT_TRUE(Children().empty());
}

// The making of a specimen goes on when its run is stopped, and may ask for content while no run is
// under way.
TEST_F(EnginesOfAWorker, GoOnAfterARunThatWasStoppedAtOnce) {
  for (int i = 0; i < 40; ++i) {
    std::stop_source stop;
    std::jthread stopper([&, i] {
      std::this_thread::sleep_for(std::chrono::microseconds(250 * i));
      stop.request_stop();
    });
    Engines fresh(Options());  // a specimen that is not made yet
    fresh.Evaluate(
        lease_, [](const v1::State& /*state*/) {}, stop.get_token());
    std::this_thread::sleep_for(std::chrono::milliseconds(i % 4));
    const auto next = fresh.Evaluate(lease_, [](const v1::State& /*state*/) {}, {});
    ASSERT_EQ(next.outcome(), v1::Finished::OUTCOME_COMPLETED) << i << ": " << next.reason();
  }
}

TEST_F(EnginesOfAWorker, SayWhyThereIsNoSpecimen) {
  EnginesOptions options = Options();
  options.fetch = [](const std::string& /*digest*/, std::stop_token /*stop*/) {
    return absl::StatusOr<std::string>(absl::NotFoundError("no such content"));
  };
  Engines engines(options);
  const auto finished = engines.Evaluate(lease_, [](const v1::State& /*state*/) {}, {});
  EXPECT_EQ(finished.outcome(), v1::Finished::OUTCOME_FAILED);
  EXPECT_EQ(finished.reason(), "no such content");
}

TEST_F(EnginesOfAWorker, SayThatTheyCannotBeStarted) {
  EnginesOptions options = Options();
  options.program = "/nowhere/calib-worker";
  Engines engines(options);
  const auto finished = engines.Evaluate(lease_, [](const v1::State& /*state*/) {}, {});
  EXPECT_EQ(finished.outcome(), v1::Finished::OUTCOME_FAILED);
  EXPECT_NE(finished.reason().find("no engine could be started"), std::string::npos)
      << finished.reason();
}

}  // namespace
}  // namespace calib::worker
