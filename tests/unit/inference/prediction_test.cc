#include "inference/prediction/prediction.h"

#include <gtest/gtest.h>

#include <cmath>

#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// mu = 5 + 2 a - b, a and b standard normal: sd of mu sqrt(5); scatter of a run 1.5.
struct Sample {
  Eigen::MatrixXd parameters, runs;
};
Sample Draw(Index n, double scatter, std::uint64_t seed) {
  Sample sample{.parameters = Eigen::MatrixXd(n, 2), .runs = Eigen::MatrixXd(n, 1)};
  for (Index i = 0; i < n; ++i) {
    PhiloxStream stream({.seed = seed,
                         .purpose = StreamPurpose::kTest,
                         .iteration = 1,
                         .sample = static_cast<std::uint64_t>(i)});
    sample.parameters.row(i) << stream.Normal(), stream.Normal();
    sample.runs(i, 0) =
        5 + 2 * sample.parameters(i, 0) - sample.parameters(i, 1) + scatter * stream.Normal();
  }
  return sample;
}

TEST(Prediction, TellsParametersFromScatterFromTheErrorOfAReading) {
  const Index n = 4000;  // a sample sd is known to 1/sqrt(2 n) = 1.1 %
  const Sample sample = Draw(n, 1.5, 1);
  const auto p = PredictQuantity(sample.parameters, sample.runs, Eigen::VectorXd::Constant(1, 2));
  ASSERT_TRUE(p.ok()) << p.status();
  EXPECT_TRUE(p->separated);
  const double sd = std::sqrt(5 + 2.25 + 4);
  EXPECT_NEAR(p->mean[0], 5, 4 * sd / std::sqrt(n));
  EXPECT_NEAR(p->sd_parameters[0] / std::sqrt(5.0), 1, 0.05);
  EXPECT_NEAR(p->sd_model[0] / 1.5, 1, 0.05);
  EXPECT_NEAR(p->sd[0] / sd, 1, 0.05);
  // Q is normal here.
  EXPECT_NEAR(p->q05[0], 5 - 1.645 * sd, 0.06 * sd);
  EXPECT_NEAR(p->q50[0], 5, 0.06 * sd);
  EXPECT_NEAR(p->q95[0], 5 + 1.645 * sd, 0.06 * sd);
  EXPECT_NEAR(ExceedanceProbability(*p, 5 + sd)[0], 0.1587, 0.015);
  EXPECT_NEAR(ExceedanceProbability(*p, 5 + 100 * sd)[0], 0, 1e-12);
  // At a level of 7: 1 - Phi(2 / sqrt(5)) by the parameters, 1 - Phi(2 / 1.5) by scatter.
  const ExceedanceParts parts = PartsOfExceedance(*p, 7);
  EXPECT_NEAR(parts.parameters[0], 0.1855, 0.025);
  EXPECT_NEAR(parts.model[0], 0.0912, 0.015);
}

TEST(Prediction, TwentyRunsAreUnbiased) {
  double own = 0;
  double model = 0;
  constexpr int kTimes = 400;
  for (int k = 0; k < kTimes; ++k) {
    const Sample sample = Draw(20, 1.5, 100 + static_cast<std::uint64_t>(k));
    const auto p = PredictQuantity(sample.parameters, sample.runs, Eigen::VectorXd::Zero(1));
    ASSERT_TRUE(p.ok());
    own += p->sd_parameters[0] * p->sd_parameters[0] / kTimes;
    model += p->sd_model[0] * p->sd_model[0] / kTimes;
  }
  // Variances of 20 runs scatter by a factor sqrt(2 / 19) and sqrt(2 / 17): 4 sd of 400 of them.
  EXPECT_NEAR(own / 5, 1, 4 * std::sqrt(2.0 / 19 / kTimes) * 1.5);
  EXPECT_NEAR(model / 2.25, 1, 4 * std::sqrt(2.0 / 17 / kTimes));
}

// A run without grains is a function of its parameters: its curvature is no scatter.
TEST(Prediction, WhatDoesNotScatterIsAllOfTheParameters) {
  Eigen::MatrixXd parameters(5, 1);
  parameters << -2, -1, 0, 1, 2;
  const Eigen::MatrixXd runs = parameters.array().square().matrix();
  const auto p = PredictQuantity(parameters, runs, Eigen::VectorXd::Constant(1, 0.5), false);
  ASSERT_TRUE(p.ok()) << p.status();
  const double variance = (4 + 1 + 4 + 1 + 4) / 4.0;  // of 4, 1, 0, 1, 4 about 2
  EXPECT_TRUE(p->separated);
  EXPECT_DOUBLE_EQ(p->sd_parameters[0], std::sqrt(variance));
  EXPECT_EQ(p->sd_model[0], 0);
  EXPECT_DOUBLE_EQ(p->sd[0], std::sqrt(variance + 0.25));
  // Two of five runs are at 4, half of their readings above it; five runs do not know their own
  // spread, so that more may lie there, but not as much as all readings of the two.
  const double above = ExceedanceProbability(*p, 4)[0];
  EXPECT_GT(above, 0.2);
  EXPECT_LT(above, 0.4);
}

TEST(Prediction, FewRunsAreNotTakenApart) {
  const Sample sample = Draw(5, 1.5, 3);
  const auto p = PredictQuantity(sample.parameters, sample.runs, Eigen::VectorXd::Zero(1));
  ASSERT_TRUE(p.ok());
  EXPECT_FALSE(p->separated);
  EXPECT_TRUE(std::isnan(p->sd_parameters[0]));
  EXPECT_TRUE(std::isfinite(p->sd[0]));
  EXPECT_LE(p->q05[0], p->q95[0]);
}

// One run more, at another draw, lies between them nine times in ten.
TEST(Prediction, QuantilesOfFewRunsHoldWhatComesNext) {
  constexpr int kTimes = 2000;
  for (const Index n : {2, 5, 8, 20}) {
    int held = 0;
    for (int k = 0; k < kTimes; ++k) {
      const Sample sample = Draw(n + 1, 1.5, 1000 + static_cast<std::uint64_t>(k));
      const auto p = PredictQuantity(sample.parameters.topRows(n), sample.runs.topRows(n),
                                     Eigen::VectorXd::Zero(1));
      ASSERT_TRUE(p.ok());
      const double next = sample.runs(n, 0);
      held += next >= p->q05[0] && next <= p->q95[0] ? 1 : 0;
    }
    EXPECT_NEAR(held / static_cast<double>(kTimes), 0.9, 0.035) << n << " runs";
  }
}

TEST(Prediction, ProbabilitiesAreThoseOfTheBand) {
  for (const Index n : {2, 5, 8, 20}) {
    for (const double error : {0.0, 2.0}) {
      const Sample sample = Draw(n, 1.5, 11);
      const auto p =
          PredictQuantity(sample.parameters, sample.runs, Eigen::VectorXd::Constant(1, error));
      ASSERT_TRUE(p.ok());
      EXPECT_NEAR(ExceedanceProbability(*p, p->q05[0])[0], 0.95, 1e-6) << n << " runs";
      EXPECT_NEAR(ExceedanceProbability(*p, p->q50[0])[0], 0.5, 1e-6) << n << " runs";
      EXPECT_NEAR(ExceedanceProbability(*p, p->q95[0])[0], 0.05, 1e-6) << n << " runs";
      for (const double probability : {0.01, 0.2, 0.5, 0.9, 0.99}) {
        const double level = QuantileOf(*p, probability)[0];
        EXPECT_NEAR(ExceedanceProbability(*p, level)[0], 1 - probability, 1e-6) << n << " runs";
      }
      EXPECT_EQ(QuantileOf(*p, 0.05)[0], p->q05[0]);
    }
  }
}

// What was given a probability of 1 % comes once in a hundred times, however few the runs: with the
// tails of a normal law the next of five runs would come four times as often.
TEST(Prediction, RareLevelsAreExceededAsRarelyAsSaid) {
  constexpr int kTimes = 1000;
  constexpr double kRare = 0.01;
  for (const Index n : {2, 5, 20}) {
    int exceeded = 0;
    for (int k = 0; k < kTimes; ++k) {
      const Sample sample = Draw(n + 1, 1.5, 5000 + static_cast<std::uint64_t>(k));
      const auto p = PredictQuantity(sample.parameters.topRows(n), sample.runs.topRows(n),
                                     Eigen::VectorXd::Zero(1));
      ASSERT_TRUE(p.ok());
      exceeded += ExceedanceProbability(*p, sample.runs(n, 0))[0] < kRare ? 1 : 0;
    }
    // Five standard errors; the parts of 20 runs are estimates, which adds as much again.
    EXPECT_NEAR(exceeded / static_cast<double>(kTimes), kRare,
                (n < 10 ? 1 : 2) * 5 * std::sqrt(kRare / kTimes))
        << n << " runs";
  }
}

// Runs that are all alike: what is off is a reading alone, or the whole history.
TEST(Prediction, SomewhereAlongTheHistoryErrorsCountToo) {
  constexpr Index kRuns = 200;
  constexpr double kLevel = 1.5;
  const double tail = 0.5 * std::erfc(kLevel / std::sqrt(2.0));
  const Eigen::MatrixXd parameters = Draw(kRuns, 0, 3).parameters;
  const Eigen::MatrixXd runs = Eigen::MatrixXd::Zero(kRuns, 3);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(3);
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(3);
  const auto read = PredictQuantity(parameters, runs, one);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_NEAR(ExceedanceAnywhere(*read, runs, none, one, kLevel), 1 - std::pow(1 - tail, 3), 1e-9);
  const QuantityPrediction off = WithModelError(*PredictQuantity(parameters, runs, none), one);
  const double shared = ExceedanceAnywhere(off, runs, one, none, kLevel);
  EXPECT_NEAR(shared, tail, 0.005);  // as much as at each reading: all are off together
  EXPECT_GE(shared, ExceedanceProbability(off, kLevel).maxCoeff());
  EXPECT_EQ(ExceedanceAnywhere(*read, runs.array() + 2, none, none, kLevel), 1);
}

TEST(Prediction, RefusesWhatDoesNotFit) {
  const Sample sample = Draw(5, 1, 3);
  EXPECT_FALSE(
      PredictQuantity(sample.parameters.topRows(4), sample.runs, Eigen::VectorXd::Zero(1)).ok());
  EXPECT_FALSE(PredictQuantity(sample.parameters, sample.runs, Eigen::VectorXd::Zero(2)).ok());
  EXPECT_FALSE(
      PredictQuantity(sample.parameters, sample.runs, Eigen::VectorXd::Constant(1, -1)).ok());
  Eigen::MatrixXd broken = sample.runs;
  broken(2, 0) = std::nan("");
  EXPECT_FALSE(PredictQuantity(sample.parameters, broken, Eigen::VectorXd::Zero(1)).ok());
}

}  // namespace
}  // namespace calib::inference
