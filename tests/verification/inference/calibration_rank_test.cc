// Simulation-based calibration [Talts et al. 2018]: truth from the prior, data from the truth; the
// posterior's distribution function at the truth is then uniform, whatever the model.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

// Largest distance of the empirical distribution from the uniform one (Kolmogorov-Smirnov), times
// sqrt(n).
double KolmogorovDistance(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  double largest = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    largest = std::max({largest, std::abs(values[i] - static_cast<double>(i) / n),
                        std::abs(values[i] - static_cast<double>(i + 1) / n)});
  }
  return largest * std::sqrt(n);
}

// A nonlinear model with correlated noise and two iterations: the ranks see a wrong prior in the
// weights, a wrong normaliser of the proposal or data counted twice.
TEST(CalibrationRank, TruthIsUniformUnderThePosterior) {
  const std::vector<Prior> priors{{.kind = PriorKind::kLogUniform, .min = 0.5, .max = 5},
                                  {.kind = PriorKind::kUniform, .min = -1, .max = 1}};
  constexpr int kTrials = 150;
  constexpr int kReadings = 6;
  std::vector<double> ranks[2];
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
    for (int j = 0; j < 2; ++j) {
      double below = 0;
      Eigen::Index row = 0;
      for (const Iteration& iteration : iterations) {
        for (Eigen::Index i = 0; i < iteration.parameters.rows(); ++i, ++row) {
          if (iteration.parameters(i, j) < truth[j]) below += std::exp(posterior->log_weights[row]);
        }
      }
      ranks[j].push_back(below);
    }
  }
  // 1.63: one in a hundred for a correct posterior; the seeds are fixed, so this passes or fails
  // for good.
  EXPECT_LT(KolmogorovDistance(ranks[0]), 1.63);
  EXPECT_LT(KolmogorovDistance(ranks[1]), 1.63);
}

}  // namespace
}  // namespace calib::inference
