// Discrepancy of a model along the path: against dense algebra, against draws whose process is
// known, against noise alone, and what it makes of predictions.
#include "inference/discrepancy/discrepancy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "inference/prediction/prediction.h"

namespace calib::inference {
namespace {

using Eigen::Index;
using ::testing::HasSubstr;

double Matern(double r) {
  const double s = std::sqrt(5.0) * r;
  return (1 + s + s * s / 3) * std::exp(-s);
}

Eigen::VectorXd Path(Index n) { return Eigen::VectorXd::LinSpaced(n, 0.02, 1.0); }

Eigen::MatrixXd Kernel(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double length) {
  Eigen::MatrixXd k(a.size(), b.size());
  for (Index i = 0; i < a.size(); ++i) {
    for (Index j = 0; j < b.size(); ++j) k(i, j) = Matern(std::abs(a[i] - b[j]) / length);
  }
  return k;
}

Eigen::VectorXd Normal(Index n, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd x(n);
  for (double& v : x) v = normal(random);
  return x;
}

Eigen::VectorXd Draw(const Eigen::MatrixXd& covariance, std::mt19937& random) {
  const Index n = covariance.rows();
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance + 1e-10 * Eigen::MatrixXd::Identity(n, n));
  return factor.matrixL() * Normal(n, random);
}

// Noise of sd 0.02 on a curve of size 1.
constexpr double kNoise = 0.02;
DiscrepancyCurve Curve(Eigen::VectorXd residual) {
  const Index n = residual.size();
  return {.path = Path(n),
          .residual = std::move(residual),
          .covariance = kNoise * kNoise * Eigen::MatrixXd::Identity(n, n),
          .scale = 1};
}

// One node of the grid and next to no prior for none: plain conditioning of a Gaussian.
TEST(Discrepancy, IsGaussianConditioning) {
  std::mt19937 random(1);
  const Eigen::VectorXd path = Path(12);
  const Eigen::VectorXd residual = 0.1 * Normal(12, random);
  Eigen::MatrixXd covariance = 0.03 * 0.03 * Kernel(path, path, 0.1);
  covariance.diagonal().array() += 0.01 * 0.01;
  const double scale = 3;
  const double a = 0.05;
  const double length = 0.3;
  const auto fit = Discrepancy::Fit(
      {{.path = path, .residual = residual, .covariance = covariance, .scale = scale}},
      {.none = 1e-300,
       .least = a,
       .most = a,
       .amplitudes = 1,
       .shortest = length,
       .longest = length,
       .lengths = 1});
  ASSERT_TRUE(fit.ok()) << fit.status();
  const Eigen::VectorXd places = Eigen::VectorXd::LinSpaced(5, 0, 1.5);
  const double variance = a * a * scale * scale;
  const Eigen::MatrixXd total = variance * Kernel(path, path, length) + covariance;
  const Eigen::MatrixXd across = variance * Kernel(places, path, length);
  const Eigen::LLT<Eigen::MatrixXd> factor(total);
  const Eigen::VectorXd mean = across * factor.solve(residual);
  const Eigen::VectorXd left =
      (variance - (across * factor.solve(across.transpose())).diagonal().array()).sqrt();
  const DiscrepancyBand band = fit->At(0, places, scale);
  EXPECT_LT((band.mean - mean).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_LT((band.sd - left).cwiseAbs().maxCoeff(), 1e-9);
  const auto log_density = [&](const Eigen::MatrixXd& c) {
    const Eigen::LLT<Eigen::MatrixXd> f(c);
    return -0.5 * residual.dot(f.solve(residual)) - f.matrixLLT().diagonal().array().log().sum();
  };
  EXPECT_NEAR(fit->log_bayes_factor(), log_density(total) - log_density(covariance), 1e-8);
  // A further experiment shares nothing with the only one unless it is said how much.
  const DiscrepancyBand further = fit->At(-1, places, 2);
  EXPECT_LT(further.mean.cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(further.sd[0], a * 2, 1e-9);
}

TEST(Discrepancy, RecoversAmplitudeAndLength) {
  const double amplitude = 0.1;
  const double length = 0.25;
  int amplitudes = 0;
  int lengths = 0;
  constexpr int kDraws = 24;
  double bias = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::mt19937 random(100 + static_cast<unsigned>(draw));
    std::vector<DiscrepancyCurve> curves;
    for (int e = 0; e < 2; ++e) {
      curves.push_back(Curve(amplitude * Draw(Kernel(Path(30), Path(30), length), random) +
                             kNoise * Normal(30, random)));
    }
    const auto fit = Discrepancy::Fit(curves);
    ASSERT_TRUE(fit.ok());
    EXPECT_GT(fit->probability(), 0.99);
    const auto a = fit->log_amplitude();
    const auto l = fit->log_length();
    amplitudes += std::abs(a.mean - std::log(amplitude)) < 2 * a.sd ? 1 : 0;
    lengths += std::abs(l.mean - std::log(length)) < 2 * l.sd ? 1 : 0;
    bias += (a.mean - std::log(amplitude)) / kDraws;
    EXPECT_LT(a.sd, 0.8);
  }
  EXPECT_GE(amplitudes, 20);  // 23 of 24 expected; fewer than 20 with probability 0.006
  EXPECT_GE(lengths, 20);
  EXPECT_LT(std::abs(bias), 0.2);
}

TEST(Discrepancy, NoiseAloneIsCompatibleWithNone) {
  int named = 0;
  double largest = 0;
  for (unsigned draw = 0; draw < 100; ++draw) {
    std::mt19937 random(draw);
    const auto fit = Discrepancy::Fit({Curve(kNoise * Normal(40, random))});
    ASSERT_TRUE(fit.ok());
    named += fit->probability() > 0.95 ? 1 : 0;
    largest += fit->At(0, Path(40), 1).rms.norm() / std::sqrt(40.0) / 100;
  }
  EXPECT_LE(named, 2);
  EXPECT_LT(largest, 0.25 * kNoise);
}

// Correlated noise must not be taken for a discrepancy when it is stated.
TEST(Discrepancy, StatedCorrelationIsNoDiscrepancy) {
  int named = 0;
  const Eigen::MatrixXd covariance =
      kNoise * kNoise *
      (0.999 * Kernel(Path(40), Path(40), 0.3) + 0.001 * Eigen::MatrixXd::Identity(40, 40));
  for (unsigned draw = 0; draw < 60; ++draw) {
    std::mt19937 random(draw);
    DiscrepancyCurve curve = Curve(Draw(covariance, random));
    curve.covariance = covariance;
    const auto fit = Discrepancy::Fit({curve});
    ASSERT_TRUE(fit.ok());
    named += fit->probability() > 0.95 ? 1 : 0;
  }
  EXPECT_LE(named, 3);
}

TEST(Discrepancy, WhatExperimentsShareIsExpectedOfTheNext) {
  std::mt19937 random(5);
  const Eigen::VectorXd common = (0.1 * (6 * Path(40).array()).sin()).matrix();
  std::vector<DiscrepancyCurve> alike;
  std::vector<DiscrepancyCurve> different;
  for (int e = 0; e < 3; ++e) {
    alike.push_back(Curve(common + kNoise * Normal(40, random)));
    different.push_back(
        Curve((e == 0 ? 1 : (e == 1 ? -1 : 0)) * common + kNoise * Normal(40, random)));
  }
  const auto same = Discrepancy::Fit(alike);
  const auto unlike = Discrepancy::Fit(different);
  ASSERT_TRUE(same.ok() && unlike.ok());
  EXPECT_GT(same->alike().mean, 0.8);
  EXPECT_LT(unlike->alike().mean, 0.3);
  const DiscrepancyBand next = same->At(-1, Path(40), 1);
  EXPECT_LT((next.mean - common).cwiseAbs().maxCoeff(), 0.04);
  const DiscrepancyBand unknown = unlike->At(-1, Path(40), 1);
  EXPECT_LT(unknown.mean.cwiseAbs().maxCoeff(), 0.04);
  EXPECT_GT(unknown.sd.minCoeff(), 0.04);
}

// Two fitted experiments and a third to be predicted, each with a smooth misfit of its own.
TEST(Discrepancy, PredictionsCoverASmoothMisfit) {
  int covered = 0;
  int without = 0;
  int all = 0;
  for (unsigned draw = 0; draw < 60; ++draw) {
    std::mt19937 random(1000 + draw);
    std::vector<DiscrepancyCurve> curves;
    const Eigen::MatrixXd kernel = Kernel(Path(30), Path(30), 0.3);
    const Eigen::VectorXd common = Draw(kernel, random);
    const auto misfit = [&] {
      return Eigen::VectorXd(0.1 *
                             (std::sqrt(0.5) * common + std::sqrt(0.5) * Draw(kernel, random)));
    };
    for (int e = 0; e < 2; ++e) curves.push_back(Curve(misfit() + kNoise * Normal(30, random)));
    const auto fit = Discrepancy::Fit(curves);
    ASSERT_TRUE(fit.ok());
    // Runs of the model at eight draws of its only parameter, scattered by packings.
    const Eigen::VectorXd parameter = Normal(8, random);
    Eigen::MatrixXd runs(8, 30);
    for (Index i = 0; i < 8; ++i) {
      runs.row(i) =
          (Eigen::VectorXd::Constant(30, 1 + 0.01 * parameter[i]) + 0.01 * Normal(30, random))
              .transpose();
    }
    const auto plain = PredictQuantity(parameter, runs, Eigen::VectorXd::Constant(30, kNoise));
    ASSERT_TRUE(plain.ok());
    const auto with = WithModelError(*plain, fit->At(-1, Path(30), 1).rms);
    const Eigen::VectorXd measured =
        Eigen::VectorXd::Constant(30, 1) - misfit() + kNoise * Normal(30, random);
    for (Index k = 0; k < 30; ++k) {
      const auto inside = [&](const QuantityPrediction& q) {
        return measured[k] >= q.q05[k] && measured[k] <= q.q95[k] ? 1 : 0;
      };
      covered += inside(with);
      without += inside(*plain);
      ++all;
      EXPECT_GE(with.sd_model[k], plain->sd_model[k]);
      EXPECT_EQ(with.sd_parameters[k], plain->sd_parameters[k]);
    }
  }
  EXPECT_GT(covered, 0.85 * all);
  EXPECT_LT(without, 0.6 * all);
}

TEST(Discrepancy, ThinningAndOrderOfCurvesMatterLittle) {
  std::mt19937 random(8);
  const Eigen::VectorXd wave = (0.1 * (5 * Path(200).array()).cos()).matrix();
  const auto fit = Discrepancy::Fit({Curve(wave + kNoise * Normal(200, random))});
  ASSERT_TRUE(fit.ok());
  const DiscrepancyBand band = fit->At(0, Path(200), 1);
  EXPECT_LT((band.mean - wave).cwiseAbs().maxCoeff(), 0.03);
  EXPECT_TRUE(band.sd.allFinite());
}

TEST(Discrepancy, RefusesWhatDoesNotFit) {
  EXPECT_FALSE(Discrepancy::Fit({}).ok());
  DiscrepancyCurve curve = Curve(Eigen::VectorXd::Zero(5));
  curve.path = Path(4);
  EXPECT_THAT(Discrepancy::Fit({curve}).status().ToString(), HasSubstr("5 residuals at 4 places"));
  curve = Curve(Eigen::VectorXd::Zero(5));
  curve.residual[2] = std::nan("");
  EXPECT_THAT(Discrepancy::Fit({curve}).status().ToString(), HasSubstr("finite"));
  curve = Curve(Eigen::VectorXd::Zero(5));
  curve.covariance.setOnes();
  curve.covariance(0, 0) = -1;
  EXPECT_THAT(Discrepancy::Fit({curve}).status().ToString(), HasSubstr("positive definite"));
  EXPECT_FALSE(Discrepancy::Fit({Curve(Eigen::VectorXd::Zero(5))}, {.least = 0}).ok());
  EXPECT_TRUE(Discrepancy::Fit({Curve(Eigen::VectorXd::Zero(1))}).ok());
}

}  // namespace
}  // namespace calib::inference
