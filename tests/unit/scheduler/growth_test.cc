// A design that grows: runs are added to it once all it had have ended.
#include "server/planning/growth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using campaign::SamplePurpose;
using ::testing::HasSubstr;
using Kind = v1::ServerMessage::MessageCase;
using S = store::CampaignState;

constexpr const char* kCell = "  load_cell_error.gain: {prior: uniform, min: 0.01, max: 0.3}\n";
constexpr const char* kAdhesion =
    "  adhesion_dmt.work_of_adhesion: {prior: log_uniform, min: 1e-3, max: 1}\n"
    "  adhesion_jkr.work_of_adhesion: {prior: log_uniform, min: 1e-3, max: 1}\n";

/// Two packings, two fitted tests; parameters: young_modulus, friction_angle, load_cell_error.gain.
testing::SmallCampaign Design(const std::string& rows = "") {
  return testing::MakeSmallDesign({.failure_attempts = 100, .packings = 2, .with_second = true},
                                  kCell, "  race: [load_cell_error]\n" + rows);
}

planning::NewRuns Scout() {
  return {.campaign = 1,
          .iteration = 0,
          .stage = SamplePurpose::kScout,
          .rows = {{{1e8, 0.3, 0}, 8}, {{1e8, 0.3, 0.1}, 9}, {{2e8, 0.4, 0.2}, 11}}};
}
planning::NewRuns Main() {
  return {.campaign = 1,
          .iteration = 1,
          .stage = SamplePurpose::kMain,
          .experiments = {"tx2"},
          .rows = {{{3e8, 0.5, 0}, 12}, {{4e8, 0.5, 0.05}, 8}}};
}

S StateOf(SimulatedService& service, std::int64_t campaign = 1) {
  return Value(service.Read().Campaign(campaign)).progress.state;
}

void ExpectAdded(SimulatedService& service, const planning::NewRuns& runs) {
  const auto added = service.AddRuns(runs);
  ASSERT_TRUE(added.ok()) << added.status();
  EXPECT_TRUE(*added);
}

/// A design that has grown by both batches, one worker, nothing in the way.
std::string Calm() {
  SimulatedService service("growth_calm");
  service.Submit(Design());
  ExpectAdded(service, Scout());
  service.RunToEnd(1, true);
  ExpectAdded(service, Main());
  service.RunToEnd(1, true);
  return service.Fingerprint();
}

TEST(Growth, ADesignIsFinishedBetweenItsBatches) {
  SimulatedService service("growth");
  EXPECT_EQ(service.Submit(Design()), "c1");
  EXPECT_EQ(StateOf(service), S::kFinished) << "nothing has been added";
  EXPECT_EQ(service.scheduler().live(), 0U);
  ExpectAdded(service, Scout());
  EXPECT_EQ(StateOf(service), S::kRunning);
  EXPECT_EQ(Value(service.Read().Evaluations(1)).size(), 6U) << "three rows, both tests";
  service.RunToEnd(1, true);
  EXPECT_EQ(StateOf(service), S::kFinished);
  service.Restart();  // nobody is connected any more
  ExpectAdded(service, Main());
  EXPECT_EQ(service.Campaign().progress.iteration, 1);
  EXPECT_EQ(service.Campaign().progress.phase, campaign::Phase::kCalibrating);
  const std::int64_t worker = service.Connect("w", 1);
  const v1::Lease lease = service.Next(worker, Kind::kLease).lease();
  EXPECT_EQ(lease.spec().seed(), 7U + 12U) << "the seed of the campaign and the stream of the row";
  EXPECT_EQ(lease.spec().experiment(), "tx2");
  EXPECT_EQ(lease.spec().effects_size(), 0) << "its gain stands at the null";
  service.scheduler().Receive(worker, v1::Leaving());
  service.ports().Run();
  service.RunToEnd(1, true);
  const auto samples = Value(service.Read().Samples(1));
  ASSERT_EQ(samples.size(), 5U);
  EXPECT_EQ(samples[2].sample, 2);
  EXPECT_EQ(samples[2].stream, 11);
  EXPECT_EQ(samples[3].sample, campaign::kMostRowsOfBatch);
  EXPECT_EQ(samples[3].iteration, 1);
  EXPECT_EQ(samples[4].parameters, (std::vector<double>{4e8, 0.5, 0.05}));
  EXPECT_EQ(Value(service.Read().Evaluations(1)).size(), 8U);
  const auto iterations = Value(service.Read().Iterations(1));
  ASSERT_EQ(iterations.size(), 2U);
  EXPECT_EQ(planning::StageIn(iterations[0].proposal), SamplePurpose::kScout);
  EXPECT_EQ(planning::StageIn(iterations[1].proposal), SamplePurpose::kMain);
  EXPECT_FALSE(iterations[1].posterior.has_value());
  EXPECT_EQ(planning::StageIn("{}"), SamplePurpose::kEnsemble);
  EXPECT_EQ(planning::StageIn("\"draws\""), SamplePurpose::kEnsemble);
}

TEST(Growth, RowsOfTheFileAreTheFirstBatch) {
  SimulatedService service("growth_rows");
  service.Submit(Design(
      "  rows: [{young_modulus: 1e8, friction_angle: 0.3, load_cell_error.gain: 0, like: 8}]\n"));
  EXPECT_EQ(StateOf(service), S::kQueued);
  service.RunToEnd(1, true);
  EXPECT_TRUE(absl::IsAlreadyExists(service.AddRuns(Scout()).status()));
  ExpectAdded(service, Main());
  service.RunToEnd(1, true);
  EXPECT_EQ(Value(service.Read().Samples(1)).size(), 3U);
}

// Neither the number of workers nor what befalls them and the server is in the results.
TEST(Growth, SameBitsForOneWorkerAndThreeWhateverGoesWrong) {
  const std::string calm = Calm();
  ASSERT_NE(calm, "");
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    SimulatedService service("growth_trouble");
    service.Submit(Design());
    ExpectAdded(service, Scout());
    service.RunToEnd(seed, false);
    ExpectAdded(service, Main());
    service.RunToEnd(seed + 100, false);
    EXPECT_TRUE(service.Fingerprint() == calm);
  }
}

// The batch is on the disk as a whole or not at all, and asking for it again ends in one.
TEST(Growth, AServerKilledWhileItAddsHasAllOrNothing) {
  const std::string calm = Calm();
  int whole = 0;
  int nothing = 0;
  for (int steps = 0; steps < 8; ++steps) {
    for (const bool in_second : {false, true}) {
      SCOPED_TRACE(steps);
      SimulatedService service("growth_killed");
      service.Submit(Design());
      if (in_second) {
        ExpectAdded(service, Scout());
        service.RunToEnd(1, true);
      }
      const planning::NewRuns runs = in_second ? Main() : Scout();
      bool said = false;
      service.scheduler().AddRuns(
          runs, [&said](const absl::StatusOr<bool>& added) { said = added.ok() && *added; });
      for (int i = 0; i < steps; ++i) service.ports().RunOne();
      service.Restart();
      const auto there = Value(service.Read().Iterations(1)).size();
      const bool added = there > static_cast<std::size_t>(runs.iteration);
      EXPECT_TRUE(added || !said) << "what was said to be added is on the disk";
      EXPECT_EQ(StateOf(service), added ? S::kRunning : S::kFinished);
      (added ? whole : nothing) += 1;
      const auto again = service.AddRuns(runs);
      ASSERT_TRUE(again.ok()) << again.status();
      EXPECT_EQ(*again, !added);
      service.RunToEnd(1, true);
      if (!in_second) {
        ExpectAdded(service, Main());
        service.RunToEnd(1, true);
      }
      EXPECT_TRUE(service.Fingerprint() == calm);
    }
  }
  EXPECT_GT(whole, 0);
  EXPECT_GT(nothing, 0);
}

TEST(Growth, TheSameBatchIsThereAndAnotherOfItsNumberIsRefused) {
  SimulatedService service("growth_again");
  service.Submit(Design());
  ExpectAdded(service, Scout());
  const auto again = [&service](const planning::NewRuns& runs) { return service.AddRuns(runs); };
  EXPECT_EQ(*again(Scout()), false) << "its runs are under way";
  service.RunToEnd(1, true);
  const std::string before = service.Fingerprint();
  EXPECT_EQ(*again(Scout()), false) << "its runs have ended";
  planning::NewRuns named = Scout();
  named.experiments = {"tx2", "tx"};
  EXPECT_EQ(*again(named), false) << "all that are fitted, by name";
  planning::NewRuns other = Scout();
  other.rows[1].values[2] = std::nextafter(0.1, 1);
  EXPECT_TRUE(absl::IsAlreadyExists(again(other).status())) << "another bit";
  other = Scout();
  other.rows[1].stream = 10;
  EXPECT_TRUE(absl::IsAlreadyExists(again(other).status())) << "another stream";
  other = Scout();
  other.rows.pop_back();
  EXPECT_TRUE(absl::IsAlreadyExists(again(other).status())) << "fewer rows";
  other = Scout();
  other.stage = SamplePurpose::kMain;
  EXPECT_TRUE(absl::IsAlreadyExists(again(other).status())) << "another stage";
  other = Scout();
  other.experiments = {"tx"};
  EXPECT_TRUE(absl::IsAlreadyExists(again(other).status())) << "another test";
  EXPECT_EQ(StateOf(service), S::kFinished);
  EXPECT_TRUE(service.Fingerprint() == before);
}

TEST(Growth, RunsMayBeAddedAsSoonAsTheDesignIsSubmitted) {
  SimulatedService service("growth_soon");
  absl::StatusOr<bool> added = absl::UnknownError("no answer");
  service.Submit(Design(), [&] {
    service.scheduler().AddRuns(Scout(),
                                [&added](const absl::StatusOr<bool>& answer) { added = answer; });
  });
  ASSERT_TRUE(added.ok()) << added.status();
  EXPECT_TRUE(*added);
  EXPECT_EQ(StateOf(service), S::kRunning);
  service.RunToEnd(1, true);
  EXPECT_EQ(Value(service.Read().Samples(1)).size(), 3U);
}

TEST(Growth, TwoWhoAddAtOnceAreAnsweredByTheirContent) {
  SimulatedService service("growth_two");
  service.Submit(Design());
  std::vector<absl::StatusOr<bool>> answers;
  planning::NewRuns other = Scout();
  other.rows.pop_back();
  for (const planning::NewRuns& runs : {Scout(), Scout(), other}) {
    service.scheduler().AddRuns(
        runs, [&answers](const absl::StatusOr<bool>& added) { answers.push_back(added); });
  }
  service.ports().Run();
  ASSERT_EQ(answers.size(), 3U);
  EXPECT_TRUE(*answers[0]);
  EXPECT_FALSE(*answers[1]);
  EXPECT_TRUE(absl::IsAlreadyExists(answers[2].status()));
  EXPECT_EQ(Value(service.Read().Samples(1)).size(), 3U);
}

TEST(Growth, IsRefusedInASentenceAndLeavesNothingBehind) {
  SimulatedService service("growth_refused");
  service.Submit(Design());
  const std::string before = service.Fingerprint();
  const auto refusal = [&service](planning::NewRuns runs, absl::StatusCode code) {
    const auto added = service.AddRuns(runs);
    EXPECT_EQ(added.status().code(), code) << added.status();
    return std::string(added.status().message());
  };
  const auto with = [](const std::function<void(planning::NewRuns&)>& change) {
    planning::NewRuns runs = Scout();
    change(runs);
    return runs;
  };
  using Code = absl::StatusCode;
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) { r.campaign = 9; }), Code::kNotFound),
              HasSubstr("no campaign c9"));
  EXPECT_THAT(
      refusal(with([](planning::NewRuns& r) { r.iteration = 1; }), Code::kFailedPrecondition),
      HasSubstr("has 0 batches, so the next is 0"));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) { r.rows.clear(); }), Code::kInvalidArgument),
              HasSubstr("0 rows; allowed: 1 to 256"));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) { r.rows.resize(257, r.rows[0]); }),
                      Code::kInvalidArgument),
              HasSubstr("257 rows"));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) { r.rows[1].values.pop_back(); }),
                      Code::kInvalidArgument),
              HasSubstr("row 1: a row has 2 values, and the campaign has 3 parameters"));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) { r.rows[2].values[1] = std::nan(""); }),
                      Code::kInvalidArgument),
              HasSubstr("row 2: friction_angle is not finite"));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) { r.rows[0].values[2] = 0.005; }),
                      Code::kInvalidArgument),
              HasSubstr("row 0: load_cell_error.gain = 0.005 lies outside its prior"));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) {
                        r.experiments = {"tx", "tz"};
                      }),
                      Code::kInvalidArgument),
              HasSubstr("some are not in campaign c1, which has tx, tx2"));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) {
                        r.experiments = {"tx", "tx"};
                      }),
                      Code::kInvalidArgument),
              HasSubstr("tx is named twice"));
  EXPECT_TRUE(service.Fingerprint() == before);
  EXPECT_EQ(StateOf(service), S::kFinished);
  // While its runs are under way, paused or given up, nothing is added.
  ExpectAdded(service, Scout());
  EXPECT_THAT(refusal(Main(), Code::kFailedPrecondition), HasSubstr("that is running"));
  const auto ok = [](const absl::Status& status) { EXPECT_TRUE(status.ok()) << status; };
  service.scheduler().Pause(1, nullptr, ok);
  service.ports().Run();
  EXPECT_THAT(refusal(Main(), Code::kFailedPrecondition), HasSubstr("that is paused"));
  service.scheduler().Cancel(1, nullptr, ok);
  service.ports().Run();
  EXPECT_THAT(refusal(Main(), Code::kFailedPrecondition), HasSubstr("that is cancelled"));
  service.Submit(testing::MakeSmallCampaign({}));
  EXPECT_THAT(refusal(with([](planning::NewRuns& r) { r.campaign = 2; }), Code::kInvalidArgument),
              HasSubstr("iterative_bayesian_filter; runs are added to a design alone"));
  service.Submit(testing::MakeSmallDesign({}, kAdhesion, "  race: [adhesion_dmt, adhesion_jkr]\n"));
  EXPECT_THAT(refusal({.campaign = 3, .rows = {{{1e8, 0.3, 0.1, 0.1}, 0}}}, Code::kInvalidArgument),
              HasSubstr("row 0: adhesion_jkr is another law of what adhesion_dmt stands for"));
}

TEST(Growth, WaitsForARoomAmongTheCampaignsThatAreNotOver) {
  SimulatedService service("growth_full");
  service.Submit(Design());
  for (int i = 0; i < kMostCampaigns; ++i) service.Submit(testing::MakeSmallCampaign({}));
  EXPECT_TRUE(absl::IsResourceExhausted(service.AddRuns(Scout()).status()));
  service.scheduler().Cancel(2, nullptr, [](const absl::Status&) {});
  service.ports().Run();
  ExpectAdded(service, Scout());
}

TEST(Growth, ARunThatTheBaseHasMadeIsNotMadeAgain) {
  SimulatedService service("growth_reused");
  service.Submit(testing::MakeSmallCampaign(
      {.samples = 6, .max_iterations = 1, .packings = 2, .with_second = true}));
  service.RunToEnd(1, true);
  const store::SampleRecord run = Value(service.Read().Samples(1))[3];
  service.Submit(Design());
  ExpectAdded(service,
              {.campaign = 2, .rows = {{{run.parameters[0], run.parameters[1], 0}, run.sample}}});
  EXPECT_EQ(StateOf(service, 2), S::kFinished) << "without a worker";
  const auto evaluations = Value(service.Read().Evaluations(2));
  ASSERT_EQ(evaluations.size(), 2U);
  EXPECT_TRUE(evaluations[0].reused && evaluations[1].reused);
  const auto made = Value(service.Read().States(1, run.sample));
  const auto taken = Value(service.Read().States(2, 0));
  ASSERT_EQ(taken.size(), made.size());
  for (std::size_t i = 0; i < taken.size(); ++i) {
    EXPECT_EQ(taken[i].observables, made[i].observables);
  }
}

TEST(Growth, GoesOnWhereTheStoreCannotBeReadForAWhile) {
  SimulatedService service("growth_unreadable");
  service.Submit(Design());
  bool added = false;
  service.scheduler().AddRuns(
      Scout(), [&added](const absl::StatusOr<bool>& answer) { added = answer.ok() && *answer; });
  while (!added) service.ports().RunOne();
  service.ports().unreadable = 1;  // when it is taken up
  service.ports().Run();
  service.Advance(std::chrono::milliseconds(10));
  service.RunToEnd(1, true);
  EXPECT_EQ(Value(service.Read().Evaluations(1)).size(), 6U);
}

}  // namespace
}  // namespace calib::scheduler
