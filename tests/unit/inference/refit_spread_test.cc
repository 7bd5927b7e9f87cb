#include "inference/scatter/refit_spread.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kReadings = 20;  // of each of two observables
constexpr double kNoise = 0.05;
constexpr double kNormal90 = 1.6449;

PhiloxStream Stream(int seed) {
  return PhiloxStream({.seed = static_cast<std::uint64_t>(seed), .purpose = StreamPurpose::kTest});
}

// Sensitivity of the histories to two parameters: a slope and a curvature, opposite in the second
// observable.
Eigen::MatrixXd Sensitivity() {
  Eigen::MatrixXd j(2 * kReadings, 2);
  for (Index i = 0; i < kReadings; ++i) {
    const double x = (static_cast<double>(i) + 1) / kReadings;
    j.row(i) << x, x * x;
    j.row(kReadings + i) << -x, 0.3 * x;
  }
  return j;
}

// What a packing does: whole curves, smooth, of both observables together.
Eigen::VectorXd Packing(PhiloxStream& stream) {
  const double slope = stream.Normal();
  const double bend = stream.Normal();
  Eigen::VectorXd departure(2 * kReadings);
  for (Index i = 0; i < kReadings; ++i) {
    const double x = (static_cast<double>(i) + 1) / kReadings;
    departure[i] = slope * x + 0.5 * bend * std::sin(2 * x);
    departure[kReadings + i] = -0.7 * slope * x + 0.4 * bend * x * x;
  }
  return departure;
}

// What is assumed of it: the right variances, a correlation length, nothing between observables.
Eigen::MatrixXd Assumed(double length) {
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(2 * kReadings);
  constexpr int kMany = 4000;
  for (int k = 0; k < kMany; ++k) {
    PhiloxStream stream = Stream(100000 + k);
    variance += Packing(stream).cwiseAbs2() / kMany;
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(2 * kReadings, 2 * kReadings);
  for (Index i = 0; i < 2 * kReadings; ++i) {
    for (Index j = 0; j < 2 * kReadings; ++j) {
      if ((i < kReadings) != (j < kReadings)) continue;
      covariance(i, j) = std::sqrt(variance[i] * variance[j]) *
                         std::exp(-std::abs(static_cast<double>(i - j)) / length);
    }
  }
  return covariance;
}

// 90 % intervals that hold the truth, of 2 x kTimes, before and after.
struct Coverage {
  double before = 0;
  double after = 0;
};
Coverage CoverageWith(int packings) {
  constexpr int kTimes = 250;
  constexpr Index kDraws = 400;
  const Eigen::MatrixXd j = Sensitivity();
  const double share = 1 + 1.0 / packings;
  const Eigen::MatrixXd scatter = share * Assumed(6);
  const Eigen::MatrixXd errors =
      scatter + kNoise * kNoise * Eigen::MatrixXd::Identity(2 * kReadings, 2 * kReadings);
  const Eigen::LLT<Eigen::MatrixXd> factor(errors);
  const Eigen::MatrixXd posterior = (j.transpose() * factor.solve(j)).inverse();
  const Eigen::MatrixXd root = Eigen::LLT<Eigen::MatrixXd>(posterior).matrixL();
  Coverage coverage;
  for (int k = 0; k < kTimes; ++k) {
    PhiloxStream stream = Stream(k);
    Eigen::MatrixXd runs(packings, 2 * kReadings);
    for (Index r = 0; r < packings; ++r) runs.row(r) = Packing(stream);
    const Eigen::RowVectorXd mean = runs.colwise().mean();
    const Replicates replicates{.departures = std::sqrt(share) * (runs.rowwise() - mean),
                                .scatter = scatter};
    Eigen::VectorXd measured = Packing(stream) - mean.transpose();
    for (double& value : measured) value += kNoise * stream.Normal();
    const Eigen::Vector2d estimate = posterior * j.transpose() * factor.solve(measured);
    Eigen::MatrixXd draws(kDraws, 2);
    for (Index s = 0; s < kDraws; ++s) {
      draws.row(s) = estimate + root * Eigen::Vector2d(stream.Normal(), stream.Normal());
    }
    const Eigen::MatrixXd spread = SpreadOfRefits(draws, draws * j.transpose(), errors, replicates);
    for (Index p = 0; p < 2; ++p) {
      const double sd = std::sqrt(posterior(p, p));
      const double widened = std::sqrt(posterior(p, p) + spread(p, p));
      coverage.before += std::abs(estimate[p]) < kNormal90 * sd ? 0.5 / kTimes : 0;
      coverage.after += std::abs(estimate[p]) < kNormal90 * widened ? 0.5 / kTimes : 0;
    }
  }
  return coverage;
}

// Standard error of a share of 0.9 of 250 pairs: at most 0.02.
TEST(RefitSpread, IntervalsHoldTheTruthAlthoughTheFormOfTheScatterIsWrong) {
  for (const int packings : {4, 10}) {
    const Coverage coverage = CoverageWith(packings);
    EXPECT_LT(coverage.before, 0.82) << packings;
    EXPECT_NEAR(coverage.after, 0.9, 0.06) << packings;
  }
}

TEST(RefitSpread, NothingIsAddedWhereTheScatterIsAsAssumed) {
  const Eigen::MatrixXd j = Sensitivity();
  const Eigen::MatrixXd scatter = Assumed(6);
  const Eigen::MatrixXd errors =
      scatter + kNoise * kNoise * Eigen::MatrixXd::Identity(2 * kReadings, 2 * kReadings);
  const Eigen::MatrixXd posterior =
      (j.transpose() * Eigen::LLT<Eigen::MatrixXd>(errors).solve(j)).inverse();
  const Eigen::MatrixXd root = Eigen::LLT<Eigen::MatrixXd>(posterior).matrixL();
  const Eigen::MatrixXd of_packing = Eigen::LLT<Eigen::MatrixXd>(scatter).matrixL();
  PhiloxStream stream = Stream(7);
  constexpr Index kMany = 400;
  Eigen::MatrixXd draws(kMany, 2);
  Eigen::MatrixXd runs(kMany, 2 * kReadings);
  for (Index s = 0; s < kMany; ++s) {
    draws.row(s) = root * Eigen::Vector2d(stream.Normal(), stream.Normal());
    Eigen::VectorXd normal(2 * kReadings);
    for (double& value : normal) value = stream.Normal();
    runs.row(s) = of_packing * normal;
  }
  const Eigen::RowVectorXd mean = runs.colwise().mean();
  const Eigen::MatrixXd spread =
      SpreadOfRefits(draws, draws * j.transpose(), errors,
                     {.departures = runs.rowwise() - mean, .scatter = scatter});
  for (Index p = 0; p < 2; ++p) EXPECT_LT(spread(p, p), 0.25 * posterior(p, p));
}

}  // namespace
}  // namespace calib::inference
