// Runs as matrices: scales, packings, numerics, and who is left out.
#include "server/diagnosis/run_matrices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

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

}  // namespace
}  // namespace calib::diagnosis
