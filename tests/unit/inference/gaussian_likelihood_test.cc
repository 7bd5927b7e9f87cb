#include "inference/data/gaussian_likelihood.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <numbers>

#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

// Two experiments, two observables each, seven steps; observable 1 of experiment 0 is correlated.
DataSet SomeData(bool correlated) {
  DataSet data;
  PhiloxStream stream({.seed = 3});
  for (int experiment = 0; experiment < 2; ++experiment) {
    for (int step = 0; step < 7; ++step) {
      for (int observable = 0; observable < 2; ++observable) {
        data.readings.push_back({.experiment = experiment,
                                 .observable = observable,
                                 .load_step = step,
                                 .control = 0.01 * step + 0.002 * stream.Uniform(),
                                 .value = stream.Normal(),
                                 .sd = 0.1 + 0.2 * stream.Uniform()});
      }
    }
  }
  if (correlated) data.correlations.push_back({.experiment = 0, .observable = 1, .length = 0.02});
  return data;
}

Eigen::MatrixXd SomePredictions(int rows, int columns) {
  PhiloxStream stream({.seed = 4});
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return stream.Normal(); });
}

// The covariance of all readings, written down directly.
Eigen::MatrixXd Covariance(const DataSet& data) {
  const auto n = static_cast<Eigen::Index>(data.readings.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const Reading& a = data.readings[i];
      const Reading& b = data.readings[j];
      if (a.experiment != b.experiment || a.observable != b.observable) continue;
      double correlation = i == j ? 1 : 0;
      for (const Correlation& c : data.correlations) {
        if (c.experiment == a.experiment && c.observable == a.observable) {
          correlation = std::exp(-std::abs(a.control - b.control) / c.length);
        }
      }
      covariance(i, j) = correlation * a.sd * b.sd;
    }
  }
  return covariance;
}

double DenseLogDensity(const Eigen::VectorXd& residual, const Eigen::MatrixXd& covariance) {
  const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
  return -0.5 * (residual.dot(factor.solve(residual)) + factor.vectorD().array().log().sum() +
                 static_cast<double>(residual.size()) * std::log(2 * std::numbers::pi));
}

// The same with a control that turns back, whose readings are no chain.
DataSet TurnedBack() {
  DataSet data = SomeData(true);
  for (Reading& reading : data.readings) reading.control = std::abs(reading.control - 0.0333);
  return data;
}

TEST(GaussianLikelihood, EqualsTheDenseGaussianDensity) {
  for (const DataSet& data : {SomeData(false), SomeData(true), TurnedBack()}) {
    const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kGiven);
    ASSERT_TRUE(likelihood.ok());
    const Eigen::MatrixXd predictions = SomePredictions(3, likelihood->readings());
    const Eigen::VectorXd result = likelihood->LogLikelihood(predictions);
    for (int i = 0; i < 3; ++i) {
      Eigen::VectorXd residual(likelihood->readings());
      for (int t = 0; t < likelihood->readings(); ++t)
        residual[t] = data.readings[t].value - predictions(i, t);
      EXPECT_NEAR(result[i], DenseLogDensity(residual, Covariance(data)),
                  1e-10 * std::abs(result[i]));
    }
  }
}

// Bits of a sample do not depend on how many others there are, whatever goes through registers.
TEST(GaussianLikelihood, RowsDoNotDependOnEachOther) {
  const Eigen::MatrixXd predictions = SomePredictions(70, 28);
  for (const DataSet& data : {SomeData(true), TurnedBack()}) {
    const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kGiven);
    const Eigen::MatrixXd together = likelihood->Increments(predictions);
    for (int i = 0; i < 70; ++i)
      EXPECT_EQ(likelihood->Increments(predictions.row(i)), together.row(i)) << i;
  }
}

TEST(GaussianLikelihood, WhatEarlierReadingsLeaveOpen) {
  Eigen::Matrix3d covariance;
  covariance << 4, 1.6, 0, 1.6, 1, 0, 0, 0, 1;
  const OpenShare least = LeastOpenShare(covariance);
  EXPECT_EQ(least.reading, 1);
  EXPECT_NEAR(least.share, 1 - 0.8 * 0.8, 1e-15);
  covariance(0, 1) = covariance(1, 0) = 2;  // the second error is half of the first
  EXPECT_EQ(LeastOpenShare(covariance).reading, 1);
  EXPECT_LE(std::abs(LeastOpenShare(covariance).share), kLeastOpenShare);
}

// Cumulative increments are the exact density of the readings so far, whatever comes later.
TEST(GaussianLikelihood, PartialSumsAreTheDensityOfTheReadingsSoFar) {
  for (const NoiseMode noise : {NoiseMode::kGiven, NoiseMode::kInferred}) {
    const DataSet data = SomeData(true);
    const auto whole = GaussianLikelihood::Create(data, noise);
    const Eigen::MatrixXd predictions = SomePredictions(2, whole->readings());
    const Eigen::MatrixXd increments = whole->Increments(predictions);
    for (const int count : {1, 5, 14, 20}) {
      DataSet part = data;
      part.readings.resize(count);
      const auto likelihood = GaussianLikelihood::Create(part, noise);
      const double expected = likelihood->LogLikelihood(predictions.leftCols(count))[1];
      EXPECT_NEAR(increments.row(1).head(count).sum(), expected, 1e-11 * std::abs(expected));
    }
  }
}

// Noise inferred: the integral over the variance factor, done by brute force.
TEST(GaussianLikelihood, InferredNoiseIsTheIntegralOverTheFactor) {
  DataSet data = SomeData(true);
  std::erase_if(data.readings,
                [](const Reading& r) { return r.experiment != 0 || r.observable != 1; });
  const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kInferred);
  const Eigen::MatrixXd predictions = SomePredictions(1, likelihood->readings());
  Eigen::VectorXd residual(likelihood->readings());
  for (int t = 0; t < likelihood->readings(); ++t)
    residual[t] = data.readings[t].value - predictions(0, t);
  const Eigen::MatrixXd covariance = Covariance(data);
  const VarianceFactorPrior prior;
  double integral =
      0;  // over ln f, midpoint rule: spectrally accurate for a density that dies at both ends
  constexpr double kStep = 0.02;
  for (double log_f = -20; log_f < 60; log_f += kStep) {
    const double f = std::exp(log_f);
    const double log_prior = prior.shape * std::log(prior.rate) - std::lgamma(prior.shape) -
                             prior.shape * log_f - prior.rate / f;  // density of ln f
    integral += kStep * std::exp(log_prior + DenseLogDensity(residual, f * covariance));
  }
  EXPECT_NEAR(likelihood->LogLikelihood(predictions)[0], std::log(integral), 1e-9);
}

TEST(GaussianLikelihood, MissingPredictionsAreNeverReached) {
  const DataSet data = SomeData(true);
  const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kGiven);
  Eigen::MatrixXd predictions = SomePredictions(2, likelihood->readings());
  predictions.row(0).tail(8).setConstant(NAN);
  const Eigen::VectorXd whole = likelihood->LogLikelihood(predictions);
  EXPECT_EQ(whole[0], -INFINITY);
  EXPECT_TRUE(std::isfinite(whole[1]));
  const Eigen::MatrixXd increments = likelihood->Increments(predictions);
  EXPECT_NEAR(likelihood->ReachedLogLikelihood(predictions)[0], increments.row(0).head(20).sum(),
              1e-12);
  EXPECT_TRUE(std::isnan(increments(0, 20)));
  EXPECT_NEAR(likelihood->ReachedLogLikelihood(predictions)[1], whole[1], 1e-12);
}

// The bound holds for any continuation, and is attained by the conditional mean.
TEST(GaussianLikelihood, BoundHoldsAndIsAttained) {
  for (const NoiseMode noise : {NoiseMode::kGiven, NoiseMode::kInferred}) {
    const DataSet data = SomeData(true);
    const auto likelihood = GaussianLikelihood::Create(data, noise);
    const Eigen::MatrixXd complete = SomePredictions(20, likelihood->readings());
    const Eigen::VectorXd final = likelihood->LogLikelihood(complete);
    for (int reached = 0; reached <= likelihood->readings(); reached += 4) {
      Eigen::MatrixXd partial = complete;
      partial.rightCols(likelihood->readings() - reached).setConstant(NAN);
      const Eigen::VectorXd bound = likelihood->LogLikelihoodBound(partial);
      for (int i = 0; i < 20; ++i) EXPECT_GE(bound[i], final[i] - 1e-10);
    }
    // One independent group: zero residual is the conditional mean.
    DataSet single = SomeData(false);
    std::erase_if(single.readings,
                  [](const Reading& r) { return r.experiment != 0 || r.observable != 0; });
    const auto one = GaussianLikelihood::Create(single, noise);
    Eigen::MatrixXd row = SomePredictions(1, 7);
    for (int t = 3; t < 7; ++t) row(0, t) = single.readings[t].value;
    Eigen::MatrixXd partial = row;
    partial.rightCols(4).setConstant(NAN);
    EXPECT_NEAR(one->LogLikelihoodBound(partial)[0], one->LogLikelihood(row)[0], 1e-12);
  }
}

TEST(GaussianLikelihood, BadDataAreRefusedWithASentence) {
  const auto problem = [](const DataSet& data, NoiseMode noise) {
    return std::string(GaussianLikelihood::Create(data, noise).status().message());
  };
  EXPECT_NE(problem({}, NoiseMode::kGiven), "");
  DataSet data = SomeData(true);
  data.readings[3].sd = 0;
  EXPECT_THAT(problem(data, NoiseMode::kGiven),
              testing::HasSubstr("experiment 0, load step 1, observable 1"));
  data = SomeData(true);
  data.readings[5].control = data.readings[3].control;
  EXPECT_THAT(problem(data, NoiseMode::kGiven), testing::HasSubstr("keep one of them"));
  data.readings[5].control += 1e-17;
  EXPECT_NE(problem(data, NoiseMode::kGiven), "");
  data = SomeData(false);
  data.readings[0].value = 0;
  EXPECT_THAT(std::string(ValidateData(data, NoiseMode::kEssTarget).message()),
              testing::HasSubstr("is zero"));
  data = SomeData(false);
  data.ess_weights = {{1, 1}};
  EXPECT_THAT(std::string(ValidateData(data, NoiseMode::kEssTarget).message()),
              testing::HasSubstr("observable 0 of experiment 1"));
}

}  // namespace
}  // namespace calib::inference
