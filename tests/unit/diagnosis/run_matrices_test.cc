// Runs as matrices: scales, packings, numerics, and who is left out.
#include "server/diagnosis/run_matrices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <utility>

#include "server/diagnosis/base_region.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;

class RunMatrices : public ::testing::Test {
 protected:
  RaceToy toy_{4, 5, 30};
  report::CampaignView view_ = toy_.Measured({.effect = 0, .units = 2}, 1);
  Race race_ = *RaceOf(view_, RaceToy::Without());
  BaseRuns base_ = *BaseRunsOf(view_);
  DesignRows rows_{AxesOver(campaign::MarginalPriors(view_.campaign), base_.values), race_,
                   Eigen::Vector4d(0.1, 0.2, 0.3, 0.4)};

  EndedRun RunAt(std::vector<double> values, int stream) const {
    return toy_.Made({.values = std::move(values), .stream = stream}, rows_.names());
  }
  std::vector<double> At(const Eigen::Vector4d& strength) const {
    return rows_.Values({.base = Eigen::MatrixXd::Zero(1, 2),
                         .strength = strength.transpose(),
                         .shape = Eigen::MatrixXd::Zero(1, 1)},
                        0);
  }
};

TEST_F(RunMatrices, HistoriesAreOnTheScaleOfTheirErrors) {
  ASSERT_EQ(base_.scale.curves().size(), 4u);
  EXPECT_EQ(base_.scale.curves()[0].stage.front(), 0);
  EXPECT_EQ(base_.scale.curves()[0].stage.back(), 2);
  EXPECT_TRUE(base_.scale.is_logarithmic(0));
  EXPECT_FALSE(base_.scale.is_logarithmic(RaceToy::kReadings));
  Eigen::MatrixXd readings = base_.readings.topRows(1);
  const Eigen::MatrixXd once = base_.scale.Scaled(readings);
  EXPECT_EQ(once, base_.histories.topRows(1));
  readings.col(0) *= std::exp(0.008);
  EXPECT_NEAR(base_.scale.Scaled(readings)(0, 0) - once(0, 0), 1, 1e-9)
      << "a relative error of one sd";
  readings(0, 0) = -1e5;  // nothing that a run says is not finite
  EXPECT_TRUE(base_.scale.Scaled(readings).allFinite());
  EXPECT_LT(base_.scale.Scaled(readings)(0, 0), once(0, 0) - 100);
  EXPECT_LT((base_.noise - Eigen::MatrixXd::Identity(96, 96)).norm(), 1e-12);
}

TEST_F(RunMatrices, DrawsForWhatWasHeldOutAreNoUnfinishedRuns) {
  v1::Sample draw = view_.samples.back();
  draw.set_index(40);
  draw.set_purpose("draw");
  view_.samples.push_back(draw);
  EXPECT_EQ(BaseRunsOf(view_)->unfinished, 0);
  EXPECT_EQ(BaseRunsOf(view_)->samples, 41);
  view_.samples.back().clear_purpose();
  EXPECT_EQ(BaseRunsOf(view_)->unfinished, 1);
}

// The campaign on one packing, its best estimate run three times more: the twins depart from the
// tenth run in both readings of the first test, and the posterior's record knows of its stress.
report::CampaignView WithTwins(report::CampaignView view) {
  for (campaign::Experiment& e : view.campaign.experiments) e.specimens.resize(1);
  for (int r = 0; r < 3; ++r) {
    v1::Sample& twin = view.samples.emplace_back(view.samples[9]);
    twin.set_index(30 + r);
    twin.set_purpose("replicate");
    for (const char* name : {"low", "high"}) {
      report::StateHistory history = view.states[{name, 9}];
      for (v1::State& state : history.states) {
        const double part = 0.01 * (r - 1) * (1 + state.load_step());
        state.set_values(0, state.values(0) * (1 + part));
        state.set_values(1, state.values(1) + part);
      }
      view.states[{name, 30 + r}] = std::move(history);
    }
  }
  v1::Posterior::Scatter& record = *view.posterior.add_scatter();
  record.set_experiment("low");
  record.set_observable("deviatoric_stress");
  record.set_from("repeats");
  record.set_runs(3);
  for (int i = 0; i < RaceToy::kReadings; ++i) record.add_sd(1e3);
  return view;
}

TEST_F(RunMatrices, TwinsAreKeptAsDeparturesOnTheScaleOfHistories) {
  const report::CampaignView view = WithTwins(view_);
  const BaseRuns base = *BaseRunsOf(view);
  ASSERT_EQ(base.twins.rows(), 3);
  ASSERT_EQ(base.twins.cols(), 96);
  EXPECT_LT(base.twins.row(1).cwiseAbs().maxCoeff(), 1e-9) << "the middle one";
  EXPECT_EQ(base.twins.rightCols(72).cwiseAbs().maxCoeff(), 0) << "of what no record knows";
  const report::StateHistory& own = view.states.at({"low", 9});
  const std::vector<double>& measured = view.campaign.experiments[0].observables[0].values;
  for (int i = 0; i < RaceToy::kReadings; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double stress = own.states[at].values(0), sd = RaceToy::kNoise * measured[at];
    EXPECT_NEAR(base.twins(2, i), 0.01 * (1 + i) * stress / sd, 1e-9) << i;
    EXPECT_NEAR(base.twins(0, i), -base.twins(2, i), 1e-9) << i;
  }
  const DesignRows rows(AxesOver(campaign::MarginalPriors(view.campaign), base.values), race_,
                        Eigen::Vector4d::Ones());
  EXPECT_EQ(SetRunsOf(base, rows, {}, WholeOf(race_)).twins, base.twins);
  EXPECT_EQ(base_.twins.rows(), 0);
}

TEST_F(RunMatrices, DeparturesAreTheScaleToFirstOrder) {
  constexpr double kSmall = 1e-6;  // of an sd: what is of second order is below 1e-7 of it
  const inference::DataSet data = campaign::MakeDataSet(view_.campaign);
  Eigen::MatrixXd value(1, 96), departure(1, 96);
  for (Index k = 0; k < 96; ++k) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
    value(0, k) = reading.value;
    departure(0, k) = kSmall * reading.sd * (1 + static_cast<double>(k));
  }
  const Eigen::MatrixXd expected =
      base_.scale.Scaled(value + departure) - base_.scale.Scaled(value);
  EXPECT_LT((base_.scale.Departures(departure) - expected).norm(), 1e-5 * expected.norm());
}

// What an emulator misses at one point all twins share; runs on other packings are of their own.
TEST_F(RunMatrices, TheFirstTwinAloneIsARunOfItsOwn) {
  report::CampaignView view = WithTwins(view_);
  const BaseRuns base = *BaseRunsOf(view);
  EXPECT_EQ(base.values.rows(), 31);
  EXPECT_EQ(base.histories.rows(), 31);
  ASSERT_EQ(base.stream.size(), 31u);
  EXPECT_EQ(base.stream.back(), 30);
  EXPECT_EQ(base.samples, 33) << "streams go on behind all of them";
  EXPECT_EQ(base.unfinished, 0);
  view.campaign.experiments[1].specimens.resize(4);
  EXPECT_EQ(BaseRunsOf(view)->values.rows(), 33);
}

TEST_F(RunMatrices, PackingsGoByStreamAndStreamsGoOn) {
  EXPECT_EQ(base_.packings, RaceToy::kPackings);
  EXPECT_EQ(base_.samples, 30);
  EXPECT_EQ(base_.unfinished, 0);
  const inference::SetRuns runs =
      SetRunsOf(base_, rows_, {{.runs = {RunAt(At({1, 0, 0, 0}), 30)}}}, WholeOf(race_));
  EXPECT_EQ(runs.histories.rows(), 31);
  EXPECT_EQ(runs.packing[29], 5);
  EXPECT_EQ(runs.packing[30], 6);
  EXPECT_NEAR(runs.points.strength(30, 0), 1, 1e-12);
  EXPECT_EQ(runs.points.strength.topRows(30).cwiseAbs().maxCoeff(), 0);
  EXPECT_EQ(runs.share, 1);
  EXPECT_TRUE(runs.histories.allFinite());
}

TEST_F(RunMatrices, NumericsAreADirectionAndNoRun) {
  std::vector<double> like = At({0, 0, 0, 0});
  for (Index j = 0; j < 2; ++j) like[static_cast<std::size_t>(j)] = base_.values(7, j);
  const std::vector<EndedBatch> batches = {
      {.runs = {RunAt(rows_.WithNumerics(like, 0), 7), RunAt(rows_.WithNumerics(like, 2), 7)}}};
  const inference::SetRuns runs = SetRunsOf(base_, rows_, batches, WholeOf(race_));
  EXPECT_EQ(runs.histories.rows(), 30);
  ASSERT_EQ(runs.staging.cols(), 2);
  // The toy adds 0.003 and 0.009 times the strain.
  EXPECT_NEAR(runs.staging(11, 0), 0.003 * 0.6 / RaceToy::kNoise, 1e-6);
  EXPECT_NEAR(runs.staging(11, 1), 0.009 * 0.6 / RaceToy::kNoise, 1e-6);
}

TEST_F(RunMatrices, RunsThatEndedEarlyOrHaveWhoIsOutAreNotThere) {
  EndedRun diverged{.run = {.values = At({0, 1, 0, 0}), .stream = 31}, .reason = "x"};
  const std::vector<EndedBatch> batches = {
      {.runs = {diverged, RunAt(At({0, 1, 0, 0}), 32), RunAt(At({1, 1, 0, 0}), 33)}}};
  EXPECT_EQ(RunsWith(rows_, batches, 1), 2);
  EXPECT_EQ(SetRunsOf(base_, rows_, batches, WholeOf(race_)).histories.rows(), 32);
  const PartOfRace without{.kept = {0, 2, 3}};
  EXPECT_EQ(SetRunsOf(base_, rows_, batches, without).histories.rows(), 30);
  const PartOfRace flat{.kept = {0, 2, 3}, .flat = {1}};
  const inference::SetRuns runs = SetRunsOf(base_, rows_, batches, flat);
  EXPECT_EQ(runs.histories.rows(), 32);
  EXPECT_EQ(runs.effects.size(), 3u);
  EXPECT_EQ(runs.points.strength(30, 0), 0) << "a run with nothing on";
  const inference::DesignPoints whole = WholePoints(rows_, flat, runs.points);
  EXPECT_EQ(whole.strength.cols(), 4);
  EXPECT_EQ(PartOfPoints(rows_, flat, whole).strength, runs.points.strength);
}

// A load cell's error is known without a run where loads count from a reading at no strain.
TEST_F(RunMatrices, LoadCellsAreCalculatedWhereTheCurvesAllowIt) {
  EXPECT_TRUE(base_.calculated.empty()) << "the first reading is at 5 % of strain";
  std::vector<std::string> without = RaceToy::Without();
  std::erase(without, "load_cell_error");
  for (campaign::Experiment& e : view_.campaign.experiments) e.control[0] = e.path[0].target = 0;
  const BaseRuns base = *BaseRunsOf(view_);
  ASSERT_EQ(base.calculated.size(), 2u);
  const Race race = WithCalculated(*RaceOf(view_, without), base);
  ASSERT_EQ(race.effects[0].strength, "load_cell_error.gain");
  EXPECT_TRUE(race.effects[0].design.calculated);
  EXPECT_FALSE(race.effects[2].design.calculated);
  EXPECT_EQ(EntriesRun(race, WholeOf(race).kept).size(), 4u);
  Eigen::VectorXd unit = Eigen::VectorXd::Constant(6, 0.1);
  unit[0] = 0.01;
  unit[1] = 1e3;
  const DesignRows rows(rows_.axes(), race, unit);
  const inference::SetRuns runs = SetRunsOf(base, rows, {}, {.kept = {0, 1, 3}});
  const inference::CalculatedDifferences& d = runs.differences;
  ASSERT_EQ(d.outputs.rows(), 64);
  EXPECT_EQ(d.without.strength.cwiseAbs().maxCoeff(), 0);
  EXPECT_EQ(d.with.strength.col(2).cwiseAbs().maxCoeff(), 0);
  EXPECT_LT(d.with.strength.col(0).minCoeff(), -1) << "both signs";
  EXPECT_TRUE(d.outputs.allFinite());
  // A gain g reads q (1 + g) but for the load at the start, an offset q + s0; strains stay.
  EXPECT_EQ(d.outputs.row(0).tail(24).cwiseAbs().maxCoeff(), 0);
  EXPECT_GT(d.outputs(0, 11) * d.with.strength(0, 0), 0);
  const double g = d.with.strength(0, 0) * 0.01;
  EXPECT_NEAR(d.outputs(0, 11) * RaceToy::kNoise, g, 0.5 * std::abs(g));
}

// A design without runs is none; where none can be made every entry is calculated all the same.
TEST_F(RunMatrices, AllEntriesAreCalculatedOfRunsMadeElsewhereAlone) {
  std::vector<std::string> without = RaceToy::Without();
  std::erase(without, "load_cell_error");
  for (campaign::Experiment& e : view_.campaign.experiments) e.control[0] = e.path[0].target = 0;
  view_.campaign.model.user_effects.clear();
  const BaseRuns own = *BaseRunsOf(view_);
  EXPECT_FALSE(own.elsewhere);
  const Race run = WithCalculated(*RaceOf(view_, without), own);
  ASSERT_EQ(run.effects.size(), 2u);
  EXPECT_EQ(EntriesRun(run, WholeOf(run).kept).size(), 2u);
  view_.campaign.precomputed.emplace();
  for (campaign::Experiment& e : view_.campaign.experiments) e.specimens.clear();
  const BaseRuns base = *BaseRunsOf(view_);
  EXPECT_TRUE(base.elsewhere);
  EXPECT_EQ(base.packings, 1);
  EXPECT_EQ(base.share, 1);
  EXPECT_EQ(base.calculated.count("apparatus_compliance.compliance"), 1u);
  const Race race = WithCalculated(*RaceOf(view_, without), base);
  EXPECT_EQ(race.effects.size(), 2u);
  EXPECT_TRUE(EntriesRun(race, WholeOf(race).kept).empty());
  const DesignRows rows(rows_.axes(), race, Eigen::Vector2d(0.01, 1e3));
  const inference::SetRuns runs = SetRunsOf(base, rows, {}, WholeOf(race));
  EXPECT_EQ(runs.histories.rows(), 30);
  EXPECT_EQ(runs.differences.outputs.rows(), 64);
  EXPECT_TRUE(runs.differences.outputs.allFinite());
}

// Hand calculation: 2 sd of the noise as scatter, all of which the measurement has, and an eighth
// of it for the mean of eight packings: sqrt(1 + 9 / 8 * 4).
TEST_F(RunMatrices, ErrorsOfAMeasurementHoldItsScatter) {
  EXPECT_EQ(base_.sd, Eigen::VectorXd::Ones(96));
  v1::Posterior::Scatter& record = *view_.posterior.add_scatter();
  record.set_experiment("high");
  record.set_observable("volumetric_strain");
  record.set_from("realizations");
  record.set_runs(8);
  record.set_share(1);
  for (int i = 0; i < RaceToy::kReadings; ++i) record.add_sd(2 * RaceToy::kNoise);
  const BaseRuns base = *BaseRunsOf(view_);
  EXPECT_EQ(base.sd.head(72), Eigen::VectorXd::Ones(72));
  EXPECT_LT((base.sd.tail(24).array() - std::sqrt(5.5)).abs().maxCoeff(), 1e-9);
}

TEST_F(RunMatrices, RegionHoldsThePosteriorAndSaysWhenRunsAreTooFew) {
  const auto region = RegionOf(base_, campaign::Priors(view_.campaign));
  ASSERT_TRUE(region.ok()) << region.status();
  EXPECT_LE(region->draws.cwiseAbs().maxCoeff(), 1);
  EXPECT_LE(region->power, 0.01);
  EXPECT_EQ(FewestBaseRuns(2), 24);
  const auto few = BaseRunsOf(RaceToy(4, 5, 20).Measured({}, 1));
  ASSERT_TRUE(few.ok());
  const auto refused = RegionOf(*few, campaign::Priors(view_.campaign)).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(refused.message(), HasSubstr("20 runs"));
  EXPECT_THAT(refused.message(), HasSubstr("it takes 24 runs"));
}

TEST_F(RunMatrices, ReadingsWithoutAnErrorCannotBeJudged) {
  view_.campaign.experiments[0].observables[0].sd.clear();
  EXPECT_EQ(BaseRunsOf(view_).status().code(), absl::StatusCode::kFailedPrecondition);
}

campaign::Campaign WithPackings(const std::vector<std::size_t>& packings) {
  campaign::Campaign campaign;
  for (const std::size_t count : packings) {
    campaign::Experiment& experiment = campaign.experiments.emplace_back();
    experiment.role = campaign::Role::kCalibrate;
    experiment.specimens.resize(count);
  }
  return campaign;
}

// A packing that is on both sides would let a draw be judged by runs on it.
TEST(PackingsApart, NoPackingOfAnyExperimentIsInTwoGroups) {
  const std::vector<std::vector<std::size_t>> cases = {{8, 8}, {4, 8}, {4, 6}, {5, 8}, {6, 9, 1}};
  for (const std::vector<std::size_t>& packings : cases) {
    const int groups = PackingsApart(WithPackings(packings));
    for (const std::size_t count : packings) {
      if (count < 2) continue;
      std::set<std::pair<std::size_t, int>> seen;
      for (int stream = 0; stream < 400; ++stream) {
        seen.emplace(static_cast<std::size_t>(stream) % count, stream % groups);
      }
      EXPECT_EQ(seen.size(), count) << packings.front() << " packings and others";
    }
  }
  EXPECT_EQ(PackingsApart(WithPackings({8, 8})), 8);
  EXPECT_EQ(PackingsApart(WithPackings({4, 8})), 4);
  EXPECT_EQ(PackingsApart(WithPackings({4, 6})), 2);
  EXPECT_EQ(PackingsApart(WithPackings({1})), 1);
}

TEST(PackingsApart, HeldOutExperimentsDoNotCount) {
  campaign::Campaign campaign = WithPackings({8, 3});
  campaign.experiments[1].role = campaign::Role::kValidate;
  EXPECT_EQ(PackingsApart(campaign), 8);
}

}  // namespace
}  // namespace calib::diagnosis
