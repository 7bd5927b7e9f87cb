#include "server/diagnosis/warm_points.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnosis/reading_effects.h"
#include "tests/support/square_campaign.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

campaign::Campaign Square() { return testing::SquareCampaign(); }

// Runs whose first reading is predicted as 1 + a - 0.3, the second as 1 + b - 0.7: truth (0.3,
// 0.7).
report::RunTable Runs(int count) {
  report::RunTable runs;
  runs.parameters.resize(count, 2);
  for (Index i = 0; i < count; ++i) {  // a lattice of golden ratios
    runs.parameters(i, 0) = std::fmod(0.5 + 0.754877666 * static_cast<double>(i), 1);
    runs.parameters(i, 1) = std::fmod(0.5 + 0.569840291 * static_cast<double>(i), 1);
  }
  runs.histories = 10 * (runs.parameters.rowwise() - Eigen::RowVector2d(0.3, 0.7));  // over the sd
  return runs;
}

// Without scatter between packings.
report::ScatteredReadings Readings() {
  return {.of_mean = campaign::MakeDataSet(Square()),
          .of_run = campaign::MakeDataSet(Square()),
          .measured = false};
}

TEST(WarmPoints, LieAboutThePosteriorThatAnEmulatorOfTheRunsGives) {
  const auto points = NextPoints(Square(), Readings(), Runs(30), {}, 1, 40);
  ASSERT_TRUE(points.ok()) << points.status();
  // The posterior's sd is 0.1; a few of forty are the defensive share of the prior.
  const Eigen::VectorXd distance =
      (points->rowwise() - Eigen::RowVector2d(0.3, 0.7)).rowwise().norm();
  EXPECT_GE((distance.array() < 0.4).count(), 32);
  EXPECT_EQ(*points, *NextPoints(Square(), Readings(), Runs(30), {}, 1, 40)) << "same bits";
}

TEST(WarmPoints, StayAwayFromWhereRunsDiverged) {
  Eigen::MatrixXd diverged(5, 2);  // where the posterior is
  diverged << 0.3, 0.7, 0.2, 0.7, 0.4, 0.7, 0.3, 0.6, 0.3, 0.8;
  const auto among_them = [&diverged](const Eigen::RowVectorXd& point) {
    const auto nearest = [&point](const Eigen::MatrixXd& to) {
      return (to.rowwise() - point).rowwise().norm().minCoeff();
    };
    return 2 * nearest(diverged) < nearest(Runs(30).parameters);
  };
  const auto count = [&](const Eigen::MatrixXd& points) {
    int there = 0;
    for (Index i = 0; i < points.rows(); ++i) there += among_them(points.row(i)) ? 1 : 0;
    return there;
  };
  const auto before = NextPoints(Square(), Readings(), Runs(30), {}, 1, 12);
  const auto points = NextPoints(Square(), Readings(), Runs(30), diverged, 1, 12);
  ASSERT_TRUE(before.ok() && points.ok()) << points.status();
  EXPECT_GE(count(*before), 3);
  EXPECT_LE(count(*points),
            1);  // seen in standardised coordinates the border is a little elsewhere
  EXPECT_EQ(points->rows(), 12);
  EXPECT_EQ(*points, *NextPoints(Square(), Readings(), Runs(30), diverged, 1, 12)) << "same bits";
}

TEST(WarmPoints, AreWhereRunsDivergedWhereNothingElseIs) {
  const Eigen::MatrixXd diverged = Runs(5).parameters;
  const auto points = NextPoints(Square(), Readings(), Runs(0), diverged, 1, 6);
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_EQ(*points, *NextPoints(Square(), Readings(), Runs(0), {}, 1, 6));
}

TEST(WarmPoints, ComeFromThePriorWhereThereIsTooLittleToGoBy) {
  const auto points = NextPoints(Square(), Readings(), Runs(4), {}, 1, 6);
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_EQ(*points, *NextPoints(Square(), Readings(), Runs(5), {}, 1, 6));
}

TEST(WarmPoints, AScreensRunCountsWhereItGivesEveryParameter) {
  const campaign::Campaign campaign = Square();
  const Eigen::VectorXd history = Eigen::Vector2d(1, 2);
  const auto table =
      RunsOfScreen({{.values = {{"a", 0.1}, {"b", 0.2}, {"fixed", 5}}, .history = history},
                    {.values = {{"a", 0.1}}, .history = history},
                    {.values = {{"a", 0.1}, {"b", 1.2}}, .history = history}},
                   campaign);
  ASSERT_EQ(table.parameters.rows(), 1);
  EXPECT_EQ(table.parameters(0, 1), 0.2);
  EXPECT_EQ(table.histories(0, 1), 2);
}

// A campaign, and its extension by a parameter.
std::pair<campaign::Campaign, campaign::Campaign> WithOnTop(const std::string& name, double min,
                                                            double max) {
  campaign::Campaign parent = Square();
  parent.experiments[0].control = {0, 0.02};
  campaign::Campaign extended = parent;
  extended.parameters.push_back(
      {.name = name,
       .unit = "1",
       .prior = {.kind = inference::PriorKind::kUniform, .min = min, .max = max}});
  return {parent, extended};
}

// Every run keeps what it was run with and is read at a strength of its own.
TEST(WarmPoints, RunsAreReadByLoadCellsOfEveryStrength) {
  const auto [parent, extended] = WithOnTop("load_cell_error.gain", -0.3, 0.3);
  const report::RunTable runs = Runs(30);
  const inference::DataSet data = campaign::MakeDataSet(parent);
  const auto misread = RunsMisread(runs, parent, data, extended);
  ASSERT_TRUE(misread);
  EXPECT_EQ(misread->parameters.leftCols(2), runs.parameters);
  EXPECT_LT(misread->parameters.col(2).minCoeff(), -0.2);
  EXPECT_GT(misread->parameters.col(2).maxCoeff(), 0.2);
  const auto expected = MisreadLoads(parent, data, runs.histories, misread->parameters.col(2),
                                     Eigen::VectorXd::Zero(30));
  ASSERT_TRUE(expected);
  EXPECT_EQ(misread->histories, *expected);
  EXPECT_GT((misread->histories - runs.histories).cwiseAbs().maxCoeff(), 0.1);
}

TEST(WarmPoints, WhatElseIsOnTopCannotBeReadIntoARun) {
  const auto [parent, extended] = WithOnTop("rolling_resistance.friction", 0, 1);
  EXPECT_FALSE(RunsMisread(Runs(5), parent, campaign::MakeDataSet(parent), extended));
}

}  // namespace
}  // namespace calib::diagnosis
