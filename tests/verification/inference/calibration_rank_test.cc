// Simulation-based calibration [Talts et al. 2018]: truth from the prior, data from the truth; the
// posterior's distribution function at the truth is then uniform, whatever the model.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <span>
#include <string>
#include <vector>

#include "inference/data/gaussian_likelihood.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/tmcmc/tmcmc.h"
#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

constexpr int kDraws = 99;  // independent ones of each posterior: ranks 0 ... 99
constexpr int kBins = 20;
constexpr int kReadings = 6;

// Pearson's statistic of ranks 0 ... draws against the uniform distribution.
double ChiSquared(const std::vector<int>& ranks, int draws) {
  std::vector<int> count(kBins, 0);
  for (const int rank : ranks) ++count[static_cast<std::size_t>(rank * kBins / (draws + 1))];
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

const std::vector<Prior>& Priors() {
  static const std::vector<Prior> priors{{.kind = PriorKind::kLogUniform, .min = 0.5, .max = 5},
                                         {.kind = PriorKind::kUniform, .min = -1, .max = 1}};
  return priors;
}

// A nonlinear model of two parameters.
Eigen::MatrixXd Predict(const Eigen::MatrixXd& p) {
  Eigen::MatrixXd predictions(p.rows(), kReadings);
  for (int t = 0; t < kReadings; ++t) {
    const double time = 0.3 * t;
    predictions.col(t) = p.col(0) * std::exp(-time) + p.col(1) * time;
  }
  return predictions;
}

// One truth from the prior, and readings of it with correlated noise.
struct Trial {
  PhiloxStream stream;
  Eigen::RowVector2d truth;
  DataSet data;

  explicit Trial(int number)
      : stream({.seed = 1000, .sample = static_cast<std::uint64_t>(number)}) {
    for (int j = 0; j < 2; ++j)
      truth[j] = Priors()[static_cast<std::size_t>(j)].Quantile(stream.Uniform());
    const Eigen::RowVectorXd exact = Predict(truth);
    data.correlations.push_back({.experiment = 0, .observable = 0, .length = 0.4});
    double error = 0;
    for (int t = 0; t < kReadings; ++t) {
      const double memory = t == 0 ? 0 : std::exp(-0.3 / 0.4);
      error = memory * error + std::sqrt(1 - memory * memory) * 0.3 * stream.Normal();
      data.readings.push_back(
          {.load_step = t, .control = 0.3 * t, .value = exact[t] + error, .sd = 0.3});
    }
  }
};

// Chi-squared of 19 degrees of freedom exceeds 43.82 once in a thousand.
void ExpectUniform(const std::string& name, const std::vector<int> (&ranks)[2], int draws) {
  std::cout << name << ": chi-squared of " << ranks[0].size()
            << " ranks, 19 degrees of freedom: " << ChiSquared(ranks[0], draws) << ", "
            << ChiSquared(ranks[1], draws) << "\n";
  EXPECT_LT(ChiSquared(ranks[0], draws), 43.82);
  EXPECT_LT(ChiSquared(ranks[1], draws), 43.82);
}

// Two iterations of the filter: the ranks see a wrong prior in the weights, a wrong normaliser of
// the proposal or data counted twice.
TEST(CalibrationRank, TruthIsUniformUnderThePosterior) {
  constexpr int kTrials = 500;
  std::vector<int> ranks[2];
  for (int trial = 0; trial < kTrials; ++trial) {
    Trial one(trial);
    const FilterOptions options{.seed = static_cast<std::uint64_t>(trial)};
    const auto iterations = RunIterations(Priors(), one.data, options, 2, 250, Predict);
    const auto posterior = ComputePosterior(Priors(), one.data, options, iterations);
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    Eigen::MatrixXd parameters(posterior->log_weights.size(), 2);
    parameters << iterations[0].parameters, iterations[1].parameters;
    for (int j = 0; j < 2; ++j) {
      ranks[j].push_back(
          RankOf(one.truth[j], parameters.col(j), posterior->log_weights, one.stream));
    }
  }
  ExpectUniform("filter", ranks, kDraws);
}

// Draws that lie far apart in a large population, so that few are related.
constexpr int kThinned = 19;
int ThinnedRank(double truth, const Eigen::VectorXd& draws) {
  int rank = 0;
  for (int k = 0; k < kThinned; ++k) rank += draws[k * (draws.size() / kThinned)] < truth ? 1 : 0;
  return rank;
}

// Chains of the whole population from the prior to the posterior: the ranks see moves that are not
// reversible, stages that stop short and chains that have not moved.
TEST(CalibrationRank, TruthIsUniformUnderTmcmc) {
  constexpr int kTrials = 500;
  constexpr std::uint64_t kFirstSeed = 1'000'000;
  std::vector<int> ranks[2];
  for (int trial = 0; trial < kTrials; ++trial) {
    const Trial one(trial);
    const auto likelihood = GaussianLikelihood::Create(one.data, NoiseMode::kGiven);
    const TmcmcOptions options{.samples = 500,
                               .seed = kFirstSeed + static_cast<std::uint64_t>(trial)};
    const auto state = RunTmcmc(Priors(), options, [&likelihood](const Eigen::MatrixXd& p) {
      return likelihood->LogLikelihood(Predict(p));
    });
    ASSERT_TRUE(state.ok()) << state.status();
    for (int j = 0; j < 2; ++j)
      ranks[j].push_back(ThinnedRank(one.truth[j], state->samples.col(j)));
  }
  ExpectUniform("tmcmc", ranks, kThinned);
}

// Thirty runs of the filter's first iteration are emulated: the ranks see an emulator's error that
// is left out, or counted where there is none.
TEST(CalibrationRank, TruthIsUniformUnderTheEmulatedPosterior) {
  constexpr int kTrials = 200;
  constexpr int kRuns = 30;
  std::vector<int> ranks[2];
  Iteration runs;
  runs.parameters = DrawSamples({}, Priors(), {}, 0, kRuns).value();
  runs.predictions = Predict(runs.parameters);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Trial one(trial);
    const auto posterior = EmulatedPosterior(
        Priors(), one.data, {.draws = 500, .seed = static_cast<std::uint64_t>(trial)},
        std::span(&runs, 1));
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    ASSERT_TRUE(posterior->adequate) << posterior->reason;
    for (int j = 0; j < 2; ++j)
      ranks[j].push_back(ThinnedRank(one.truth[j], posterior->draws.col(j)));
  }
  ExpectUniform("emulator", ranks, kThinned);
}

}  // namespace
}  // namespace calib::inference
