#include "server/report/views/run_table.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

constexpr double kScatter = 0.06;
constexpr double kLength = 0.02;

void AddScatter(CampaignView& view, const char* from) {
  v1::Posterior::Scatter& scatter = *view.posterior.add_scatter();
  const campaign::Experiment& experiment = view.campaign.experiments[0];
  scatter.set_experiment(experiment.name);
  scatter.set_observable(experiment.observables[0].name);
  for (std::size_t i = 0; i < experiment.control.size(); ++i) scatter.add_sd(kScatter);
  scatter.set_correlation_length(kLength);
  scatter.set_share(0.5);
  scatter.set_from(from);
  scatter.set_runs(4);
}

TEST(RunTable, ScatterBetweenPackingsWidensTheErrorsOnce) {
  CampaignView view = testing::ExampleView("scattered");
  const inference::DataSet plain = campaign::MakeDataSet(view.campaign);
  const RunTable runs = RunsOf(view);
  AddScatter(view, "realizations");
  const ScatteredReadings readings = ReadingsWithScatter(view);
  ASSERT_TRUE(readings.measured);
  ASSERT_EQ(readings.of_mean.readings.size(), plain.readings.size());
  const RunTable scaled = RunsOf(view, readings.of_mean);
  for (std::size_t k = 0; k < plain.readings.size(); ++k) {
    const double sd = plain.readings[k].sd;
    const bool scattered = plain.readings[k].observable == 0;
    // Half of a run's variance in the specimen, a quarter in the mean of four packings, one in a
    // run.
    const double of_mean = std::hypot(sd, scattered ? std::sqrt(0.75) * kScatter : 0);
    EXPECT_NEAR(readings.of_mean.readings[k].sd, of_mean, 1e-12);
    EXPECT_NEAR(readings.of_run.readings[k].sd,
                std::hypot(sd, scattered ? std::sqrt(1.5) * kScatter : 0), 1e-12);
    const auto at = static_cast<Eigen::Index>(k);
    EXPECT_NEAR(scaled.histories(7, at), runs.histories(7, at) * sd / of_mean, 1e-9);
  }
  const std::vector<int> group = inference::GroupsOf(plain).begin()->second;
  const Eigen::MatrixXd correlation = inference::ErrorCorrelation(readings.of_mean, {0, 0}, group);
  const auto at = [&](int i) { return readings.of_mean.readings[static_cast<std::size_t>(i)]; };
  const double distance = at(group[30]).control - at(group[20]).control;
  EXPECT_NEAR(correlation(20, 30) * at(group[20]).sd * at(group[30]).sd,
              0.75 * kScatter * kScatter * std::exp(-distance / kLength), 1e-9);
}

TEST(RunTable, UnitsMayComeFromACampaignWithHeldOutExperiments) {
  CampaignView view = testing::ExampleView("held out first");
  std::swap(view.campaign.experiments[0], view.campaign.experiments[1]);
  const ScatteredReadings readings = ReadingsWithScatter(view);
  EXPECT_EQ(readings.of_mean.readings.front().experiment, 1);
  CampaignView derived = view;
  derived.campaign.experiments.erase(derived.campaign.experiments.begin());
  const RunTable runs = RunsOf(derived, readings.of_mean);
  ASSERT_GT(runs.sample.size(), 0U);
  EXPECT_EQ(runs.histories, RunsOf(view).histories);
}

// Twins of the best estimate: every sample is one of its own, so that their mean is off by nothing.
TEST(RunTable, TwinsDepartFromTheirMeanInWhatTheyHavePartedIn) {
  CampaignView view = testing::ExampleView("twins");
  const inference::DataSet plain = campaign::MakeDataSet(view.campaign);
  AddScatter(view, "repeats");
  constexpr int kFirst = 500, kTwins = 4, kStrength = 2;  // the value that AddScatter is about
  for (int r = 0; r < kTwins; ++r) {
    v1::Sample& sample = view.samples.emplace_back(view.samples.front());
    sample.set_index(kFirst + r);
    sample.set_purpose("replicate");
    StateHistory history = view.states.at({"tx02", 7});
    for (v1::State& state : history.states) {
      for (int k = 0; k < state.values_size(); ++k) {
        state.set_values(k, state.values(k) + (k == kStrength ? 0.01 : 1e-9) * r);
      }
    }
    view.states[{"tx02", kFirst + r}] = history;
  }
  const ScatteredReadings readings = ReadingsWithScatter(view);
  EXPECT_TRUE(readings.measured);
  EXPECT_EQ(readings.departures.rows(), 0) << "no packing was varied";
  ASSERT_EQ(readings.twins.rows(), kTwins);
  for (std::size_t k = 0; k < plain.readings.size(); ++k) {
    const bool parted = plain.readings[k].observable == 0;
    const auto at = static_cast<Eigen::Index>(k);
    EXPECT_NEAR(readings.twins(3, at), parted ? 0.015 : 0, 1e-12);
    EXPECT_NEAR(readings.twins.col(at).sum(), 0, 1e-12);
    EXPECT_NEAR(readings.of_mean.readings[k].sd,
                std::hypot(plain.readings[k].sd, parted ? std::sqrt(0.5) * kScatter : 0), 1e-12);
  }
}

TEST(RunTable, ScatterOfSingleRunsIsLeftToTheEmulator) {
  CampaignView view = testing::ExampleView("single");
  AddScatter(view, "emulator");
  const ScatteredReadings readings = ReadingsWithScatter(view);
  EXPECT_FALSE(readings.measured);
  const inference::DataSet plain = campaign::MakeDataSet(view.campaign);
  for (std::size_t k = 0; k < plain.readings.size(); ++k) {
    EXPECT_EQ(readings.of_mean.readings[k].sd, plain.readings[k].sd);
    EXPECT_EQ(readings.of_run.readings[k].sd, plain.readings[k].sd);
  }
}

}  // namespace
}  // namespace calib::report
