// Simulation-based calibration [Talts et al. 2018]: truth from the prior, data from the truth; the
// posterior's distribution function at the truth is then uniform, whatever the model.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

constexpr int kDraws = 99;  // independent ones of each posterior: ranks 0 ... 99
constexpr int kBins = 20;

// Pearson's statistic of ranks against the uniform distribution.
double ChiSquared(const std::vector<int>& ranks) {
  std::vector<int> count(kBins, 0);
  for (const int rank : ranks) ++count[static_cast<std::size_t>(rank * kBins / (kDraws + 1))];
  const double expected = static_cast<double>(ranks.size()) / kBins;
  double sum = 0;
  for (const int one : count) sum += (one - expected) * (one - expected) / expected;
  return sum;
}

// How many of kDraws independent draws from the weighted samples lie below the truth.
int RankOf(double truth, const Eigen::VectorXd& values, const Eigen::VectorXd& log_weights,
           PhiloxStream& stream) {
  Eigen::VectorXd cumulative(values.size());
  double sum = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) cumulative[i] = sum += std::exp(log_weights[i]);
  int rank = 0;
  for (int k = 0; k < kDraws; ++k) {
    const double u = sum * stream.Uniform();
    const auto at = std::upper_bound(cumulative.begin(), cumulative.end(), u) - cumulative.begin();
    rank += values[std::min<Eigen::Index>(at, values.size() - 1)] < truth ? 1 : 0;
  }
  return rank;
}

// A nonlinear model with correlated noise and two iterations: the ranks see a wrong prior in the
// weights, a wrong normaliser of the proposal or data counted twice.
TEST(CalibrationRank, TruthIsUniformUnderThePosterior) {
  const std::vector<Prior> priors{{.kind = PriorKind::kLogUniform, .min = 0.5, .max = 5},
                                  {.kind = PriorKind::kUniform, .min = -1, .max = 1}};
  constexpr int kTrials = 500;
  constexpr int kReadings = 6;
  std::vector<int> ranks[2];
  for (int trial = 0; trial < kTrials; ++trial) {
    PhiloxStream stream({.seed = 1000, .sample = static_cast<std::uint64_t>(trial)});
    const double truth[2] = {priors[0].Quantile(stream.Uniform()),
                             priors[1].Quantile(stream.Uniform())};
    const auto model = [](double a, double b, double t) { return a * std::exp(-t) + b * t; };
    DataSet data;
    data.correlations.push_back({.experiment = 0, .observable = 0, .length = 0.4});
    double error = 0;
    for (int t = 0; t < kReadings; ++t) {
      const double time = 0.3 * t;
      const double memory = t == 0 ? 0 : std::exp(-0.3 / 0.4);
      error = memory * error + std::sqrt(1 - memory * memory) * 0.3 * stream.Normal();
      data.readings.push_back({.load_step = t,
                               .control = time,
                               .value = model(truth[0], truth[1], time) + error,
                               .sd = 0.3});
    }
    const auto predict = [&](const Eigen::MatrixXd& p) {
      Eigen::MatrixXd predictions(p.rows(), kReadings);
      for (Eigen::Index i = 0; i < p.rows(); ++i) {
        for (int t = 0; t < kReadings; ++t) predictions(i, t) = model(p(i, 0), p(i, 1), 0.3 * t);
      }
      return predictions;
    };
    const FilterOptions options{.seed = static_cast<std::uint64_t>(trial)};
    const auto iterations = RunIterations(priors, data, options, 2, 250, predict);
    const auto posterior = ComputePosterior(priors, data, options, iterations);
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    Eigen::MatrixXd parameters(posterior->log_weights.size(), 2);
    parameters << iterations[0].parameters, iterations[1].parameters;
    for (int j = 0; j < 2; ++j) {
      ranks[j].push_back(RankOf(truth[j], parameters.col(j), posterior->log_weights, stream));
    }
  }
  // Chi-squared of 19 degrees of freedom exceeds 43.8 once in a thousand.
  EXPECT_LT(ChiSquared(ranks[0]), 43.82);
  EXPECT_LT(ChiSquared(ranks[1]), 43.82);
  std::cout << "chi-squared of " << kTrials
            << " ranks, 19 degrees of freedom: " << ChiSquared(ranks[0]) << ", "
            << ChiSquared(ranks[1]) << "\n";
}

}  // namespace
}  // namespace calib::inference
