#include "inference/scatter/scatter.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "inference/data/gaussian_likelihood.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Runs whose departures are a Markov chain of the given sd (double beyond half way) and length.
Eigen::MatrixXd Chains(Index runs, Index n, double sd, double length, std::uint64_t seed) {
  Eigen::MatrixXd result(runs, n);
  const double rho = std::exp(-1 / length);
  for (Index r = 0; r < runs; ++r) {
    PhiloxStream stream({.seed = seed,
                         .purpose = StreamPurpose::kTest,
                         .iteration = 1,
                         .sample = static_cast<std::uint64_t>(r)});
    double u = stream.Normal();
    for (Index i = 0; i < n; ++i) {
      if (i > 0) u = rho * u + std::sqrt(1 - rho * rho) * stream.Normal();
      result(r, i) = 3 + (2 * i < n ? sd : 2 * sd) * u;
    }
  }
  return result;
}

std::vector<int> TwoStages(Index n) {
  std::vector<int> stage;
  for (Index i = 0; i < n; ++i) stage.push_back(2 * i < n ? 0 : 1);
  return stage;
}

TEST(Scatter, FindsSdOfEachStageAndLength) {
  // 400 chains of 40 readings, about 8 correlation lengths: sd to 1/sqrt(2 * 400 * 4), 2 %.
  const Index n = 40;
  const auto scatter = FitScatter(MomentsOfReplicates(Chains(400, n, 0.1, 5, 1)), TwoStages(n),
                                  Eigen::VectorXd::LinSpaced(n, 1, n));
  EXPECT_NEAR(scatter.sd[0], 0.1, 4 * 0.1 * 0.02);
  EXPECT_NEAR(scatter.sd[n - 1], 0.2, 4 * 0.2 * 0.02);
  EXPECT_EQ(scatter.sd[0], scatter.sd[n / 2 - 1]) << "stationary, as these chains are";
  EXPECT_NEAR(scatter.length, 5, 0.5);
  EXPECT_NEAR(ScatterCovariance(scatter)(3, 6), 0.01 * std::exp(-3.0 / 5), 0.01 * 0.05);
}

// Packings in one state of stress that drift apart: a Wiener process W, Var W(x) = x, or x W.
Eigen::MatrixXd FromOneStart(Index runs, Index n, bool slowly, std::uint64_t seed) {
  Eigen::MatrixXd result(runs, n);
  for (Index r = 0; r < runs; ++r) {
    PhiloxStream stream({.seed = seed,
                         .purpose = StreamPurpose::kTest,
                         .iteration = 1,
                         .sample = static_cast<std::uint64_t>(r)});
    double walk = 0;
    for (Index i = 0; i < n; ++i) {
      walk += stream.Normal();
      result(r, i) = slowly ? static_cast<double>(i + 1) * walk : walk;
    }
  }
  return result;
}

TEST(Scatter, PackingsThatStartAlikeDriftApart) {
  const Index n = 30;
  const Eigen::VectorXd control = Eigen::VectorXd::LinSpaced(n, 1, n);
  const std::vector<int> one_stage(n, 0);
  for (const bool slowly : {false, true}) {
    const auto scatter =
        FitScatter(MomentsOfReplicates(FromOneStart(400, n, slowly, 3)), one_stage, control);
    for (const Index i : {0, 4, 14, 29}) {
      EXPECT_NEAR(scatter.sd[i] / std::pow(control[i], slowly ? 1.5 : 0.5), 1, 0.15)
          << i << ' ' << slowly;
    }
    // Increments of a Wiener process do not know the past.
    const Eigen::MatrixXd covariance = ScatterCovariance(scatter);
    EXPECT_NEAR(covariance(29, 9) / covariance(9, 9), slowly ? 3 : 1, slowly ? 0.3 : 0.1);
  }
}

TEST(Scatter, ReadingAtTheStartItselfHasNone) {
  const Index n = 20;
  Eigen::MatrixXd runs(6, n + 1);
  runs << Eigen::VectorXd::Constant(6, 1.0), FromOneStart(6, n, false, 5);
  const auto scatter = FitScatter(MomentsOfReplicates(runs), std::vector<int>(n + 1, 0),
                                  Eigen::VectorXd::LinSpaced(n + 1, 0, n));
  EXPECT_LT(scatter.sd[0], 0.05 * scatter.sd[n]);
  EXPECT_GT(scatter.sd[1], 0.05 * scatter.sd[n]);
  EXPECT_TRUE(ScatterCovariance(scatter).allFinite());
  // A stage of its own for the start does not take the others their correlation.
  std::vector<int> stages(n + 1, 1);
  stages[0] = 0;
  const auto staged =
      FitScatter(MomentsOfReplicates(runs), stages, Eigen::VectorXd::LinSpaced(n + 1, 0, n));
  EXPECT_GT(staged.length, 0);
  EXPECT_LT(staged.sd[0], 0.01 * staged.sd[n]);
  EXPECT_GT(staged.clock[n] - staged.clock[n - 1], 0);
  EXPECT_LT(staged.clock[n] - staged.clock[n - 1], 1);
}

TEST(Scatter, FourPackingsAreUnbiasedOnAverage) {
  const Index n = 30;
  double variance = 0;
  constexpr int kTimes = 300;
  for (int k = 0; k < kTimes; ++k) {
    const auto scatter =
        FitScatter(MomentsOfReplicates(Chains(4, n, 0.1, 10, 10 + static_cast<std::uint64_t>(k))),
                   TwoStages(n), Eigen::VectorXd::LinSpaced(n, 1, n));
    variance += scatter.sd[0] * scatter.sd[0] / kTimes;
    EXPECT_GT(scatter.length, 0) << k;
  }
  // The variance of one estimate is at most 2/3 of its square: 4 sd of the mean of 300.
  EXPECT_NEAR(variance, 0.01, 4 * 0.01 * std::sqrt(2.0 / 3 / kTimes));
}

TEST(Scatter, IndependentReadingsHaveNextToNoLength) {
  const Index n = 40;
  const auto scatter = FitScatter(MomentsOfReplicates(Chains(200, n, 0.1, 0.05, 2)), TwoStages(n),
                                  Eigen::VectorXd::LinSpaced(n, 1, n));
  EXPECT_LT(std::exp(-1 / std::max(scatter.length, 1e-9)), 0.05);
}

TEST(Scatter, EqualRunsHaveNone) {
  const auto scatter = FitScatter(MomentsOfReplicates(Eigen::MatrixXd::Constant(3, 5, 2)),
                                  {0, 0, 0, 1, 1}, Eigen::VectorXd::LinSpaced(5, 0, 1));
  EXPECT_EQ(scatter.sd.maxCoeff(), 0);
  EXPECT_EQ(scatter.length, 0);
}

DataSet ThreeReadings() {
  DataSet data;
  for (int i = 0; i < 3; ++i) {
    data.readings.push_back({.load_step = i, .control = 1.0 * i, .value = 1.0 + i, .sd = 0.3});
  }
  return data;
}

TEST(Scatter, JoinsTheErrorsOnceForTheRunAndOnceForTheSpecimen) {
  const GroupScatter scatter{.sd = Eigen::Vector3d(0.4, 0.4, 0.8),
                             .clock = Eigen::Vector3d(0, 0.5, 1),
                             .length = 2,
                             .share = 0.25};
  const DataSet with = WithScatter(ThreeReadings(), {scatter}, 1);
  ASSERT_EQ(with.covariances.size(), 1U);
  EXPECT_NEAR(with.readings[0].sd, std::sqrt(0.09 + 1.25 * 0.16), 1e-12);
  EXPECT_NEAR(with.covariances[0].matrix(0, 2), 1.25 * 0.4 * 0.8 * std::exp(-1.0), 1e-12);
  // The density is that of the multivariate normal with this covariance.
  const auto likelihood = GaussianLikelihood::Create(with, NoiseMode::kGiven);
  ASSERT_TRUE(likelihood.ok()) << likelihood.status();
  Eigen::MatrixXd prediction(1, 3);
  prediction << 1.5, 2.2, 2;
  const Eigen::Vector3d residual(0.5, 0.2, -1);
  const Eigen::MatrixXd& sigma = with.covariances[0].matrix;
  const double expected = -0.5 * residual.dot(sigma.inverse() * residual) -
                          0.5 * std::log(sigma.determinant()) - 1.5 * std::log(2 * M_PI);
  EXPECT_NEAR(likelihood->LogLikelihood(prediction)[0], expected, 1e-12);
  EXPECT_NEAR(likelihood->Increments(prediction).sum(), expected, 1e-12);
}

TEST(Scatter, WrongCovariancesAreRefusedWithASentence) {
  DataSet data = ThreeReadings();
  data.covariances.push_back({0, 0, 0.09 * Eigen::MatrixXd::Identity(2, 2)});
  EXPECT_FALSE(ValidateData(data, NoiseMode::kGiven).ok());
  data.covariances[0].matrix = 0.08 * Eigen::MatrixXd::Identity(3, 3);
  EXPECT_FALSE(ValidateData(data, NoiseMode::kGiven).ok());
  data.covariances[0].matrix = 0.09 * Eigen::MatrixXd::Identity(3, 3);
  EXPECT_TRUE(ValidateData(data, NoiseMode::kGiven).ok());
  data.covariances[0].matrix(0, 1) = 0.01;
  EXPECT_FALSE(ValidateData(data, NoiseMode::kGiven).ok());
  data.covariances[0].matrix.setConstant(0.09);
  const auto singular = GaussianLikelihood::Create(data, NoiseMode::kGiven);
  ASSERT_FALSE(singular.ok());
  EXPECT_NE(singular.status().message().find("singular"), std::string_view::npos);
}

// A smooth model follows the small step of its parameters on a line; chance does not.
TEST(HaveParted, WhatLiesOnALineHasNot) {
  const Index n = 5;
  const Eigen::VectorXd number = Eigen::VectorXd::LinSpaced(8, 0, 7);
  const Eigen::VectorXd noise = Eigen::VectorXd::Constant(n, 0.1);
  Eigen::MatrixXd runs(8, n);
  for (Index r = 0; r < 8; ++r) {
    for (Index i = 0; i < n; ++i) runs(r, i) = 3 + 1e-4 * number[r] * static_cast<double>(i + 1);
  }
  EXPECT_FALSE(HaveParted(runs, number, noise));
  EXPECT_FALSE(HaveParted(runs({0, 2, 5}, Eigen::all), number({0, 2, 5}), noise)) << "some failed";
  runs(3, 4) += 1e-8;
  EXPECT_FALSE(HaveParted(runs, number, noise));
  runs(3, 4) += 1e-6;
  EXPECT_TRUE(HaveParted(runs, number, noise));
  // Of two there is no line to tell: their difference decides.
  EXPECT_TRUE(HaveParted(runs.topRows(2), number.head(2), noise));
  EXPECT_FALSE(HaveParted(runs({0, 0}, Eigen::all), number.head(2), noise));
}

}  // namespace
}  // namespace calib::inference
