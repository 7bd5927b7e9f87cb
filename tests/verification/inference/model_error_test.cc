// A model error that is inferred beside the stated errors, against quadratures made here.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "inference/data/gaussian_likelihood.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/filter/posterior_checks.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/special_functions.h"
#include "inference/sampling/philox.h"
#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Readings of two observables about 3 and about 1, off the zero prediction's neighbourhood.
DataSet TwoCurves() {
  PhiloxStream stream({.seed = 5});
  DataSet data;
  for (int t = 0; t < 8; ++t) {
    for (int j = 0; j < 2; ++j) {
      data.readings.push_back({.observable = j,
                               .load_step = t,
                               .control = 0.1 * t,
                               .value = (j == 0 ? 3 : 1) + 0.2 * t + 0.1 * stream.Normal(),
                               .sd = 0.02 + 0.01 * t});
    }
  }
  return data;
}

// Two rows: close to the readings and far off.
Eigen::MatrixXd TwoRows(const DataSet& data) {
  PhiloxStream stream({.seed = 6});
  Eigen::MatrixXd rows(2, static_cast<Eigen::Index>(data.readings.size()));
  for (Eigen::Index t = 0; t < rows.cols(); ++t) {
    const double y = data.readings[static_cast<std::size_t>(t)].value;
    rows(0, t) = y + 0.03 * stream.Normal();
    rows(1, t) = y + 0.25 * stream.Normal();
  }
  return rows;
}

double LogNormal(double residual, double sd) {
  return -0.5 * std::log(2 * std::numbers::pi) - std::log(sd) - 0.5 * std::pow(residual / sd, 2);
}

// Nodes of a midpoint rule over the prior of a standard deviation, by probability: whatever the
// prior, they weigh the same.
std::vector<double> Nodes(const std::optional<ErrorScale>& scale, int count) {
  if (!scale) return {0};
  std::vector<double> nodes;
  for (int k = 0; k < count; ++k) {
    const double x = scale->prior.Quantile((k + 0.5) / count);
    nodes.push_back(scale->on_variance ? std::sqrt(x) : x);
  }
  return nodes;
}

// ln of the mean over the nodes of the density of the readings of one observable.
double ByNodes(const DataSet& data, const Eigen::RowVectorXd& row, const ModelError& error,
               int count) {
  std::vector<double> logs;
  for (const double relative : Nodes(error.relative, count)) {
    for (const double absolute : Nodes(error.absolute, count)) {
      double sum = 0;
      for (std::size_t t = 0; t < data.readings.size(); ++t) {
        const Reading& r = data.readings[t];
        if (std::find(error.members.begin(), error.members.end(),
                      std::pair(r.experiment, r.observable)) == error.members.end()) {
          continue;
        }
        sum += LogNormal(row[static_cast<Eigen::Index>(t)] - r.value,
                         std::hypot(r.sd, relative * r.value, absolute));
      }
      logs.push_back(sum);
    }
  }
  const Eigen::Map<const Eigen::VectorXd> all(logs.data(), static_cast<Eigen::Index>(logs.size()));
  return LogSumExp(all) - std::log(static_cast<double>(logs.size()));
}

const ErrorScale kUniformSd{.prior = {.kind = PriorKind::kUniform, .min = 0, .max = 0.2}};
const ErrorScale kUniformVariance{.prior = {.kind = PriorKind::kUniform, .min = 0, .max = 0.01},
                                  .on_variance = true};
const ErrorScale kHalfNormal{.prior = {.kind = PriorKind::kNormal, .min = 0, .mean = 0, .sd = 0.3}};
const ErrorScale kLogUniform{.prior = {.kind = PriorKind::kLogUniform, .min = 1e-3, .max = 1}};

TEST(ModelError, LikelihoodIsTheMeanOverThePrior) {
  for (const auto& [relative, absolute] :
       std::vector<std::pair<std::optional<ErrorScale>, std::optional<ErrorScale>>>{
           {kUniformSd, {}},
           {kUniformVariance, {}},
           {{}, kHalfNormal},
           {{}, kLogUniform},
           {kUniformSd, kHalfNormal}}) {
    DataSet data = TwoCurves();
    data.model_errors = {{.members = {{0, 0}}, .relative = relative, .absolute = absolute},
                         {.members = {{0, 1}}, .relative = relative, .absolute = absolute}};
    const Eigen::MatrixXd rows = TwoRows(data);
    const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kModelError);
    ASSERT_TRUE(likelihood.ok()) << likelihood.status();
    const Eigen::VectorXd found = likelihood->LogLikelihood(rows);
    const bool both = relative && absolute;
    for (Eigen::Index i = 0; i < 2; ++i) {
      double expected = 0;
      for (const ModelError& error : data.model_errors) {
        expected += ByNodes(data, rows.row(i), error, both ? 600 : 100'000);
      }
      EXPECT_NEAR(found[i], expected, 2 * 0.03) << i << " of " << expected;
    }
  }
}

// Both observables have one sigma: the product under one mean, not of two.
TEST(ModelError, MembersShareIt) {
  DataSet data = TwoCurves();
  const ModelError shared{.members = {{0, 0}, {0, 1}}, .relative = kUniformSd};
  data.model_errors = {shared};
  const Eigen::MatrixXd rows = TwoRows(data);
  const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kModelError);
  ASSERT_TRUE(likelihood.ok());
  for (Eigen::Index i = 0; i < 2; ++i) {
    EXPECT_NEAR(likelihood->LogLikelihood(rows)[i], ByNodes(data, rows.row(i), shared, 100'000),
                0.01);
  }
}

// With next to no freedom the errors are sqrt(sd^2 + (0.05 y)^2), correlated as stated; the other
// observable has its stated ones.
TEST(ModelError, StatedCorrelationHoldsForTheSum) {
  for (const bool in_full : {false, true}) {
    DataSet data = TwoCurves();
    data.correlations = {{.observable = 0, .length = 0.3}};
    if (in_full) {
      const Eigen::MatrixXd all = ErrorCovariance(data);
      const auto of_first = Eigen::seq(0, Eigen::last, 2);
      data.covariances = {{.observable = 0, .matrix = all(of_first, of_first)}};
      data.correlations.clear();
    }
    data.model_errors = {
        {.members = {{0, 0}},
         .relative = ErrorScale{.prior = {.min = 0.05 * (1 - 1e-9), .max = 0.05 * (1 + 1e-9)}}}};
    DataSet raised = TwoCurves();
    for (Reading& r : raised.readings) {
      if (r.observable == 0) r.sd = std::hypot(r.sd, 0.05 * r.value);
    }
    raised.correlations = {{.observable = 0, .length = 0.3}};
    const Eigen::MatrixXd rows = TwoRows(data);
    const auto found = GaussianLikelihood::Create(data, NoiseMode::kModelError);
    const auto expected = GaussianLikelihood::Create(raised, NoiseMode::kGiven);
    ASSERT_TRUE(found.ok() && expected.ok());
    EXPECT_TRUE(found->Increments(rows).isApprox(expected->Increments(rows), 1e-7)) << in_full;
  }
}

TEST(ModelError, IncrementsSumAndTheBoundIsNeverPassed) {
  DataSet data = TwoCurves();
  data.model_errors = {{.members = {{0, 0}, {0, 1}}, .relative = kUniformSd}};
  const auto likelihood = GaussianLikelihood::Create(data, NoiseMode::kModelError);
  ASSERT_TRUE(likelihood.ok());
  PhiloxStream stream({.seed = 8});
  for (int trial = 0; trial < 50; ++trial) {
    Eigen::MatrixXd row = TwoRows(data).row(trial % 2);
    for (double& x : row.reshaped()) x += 0.3 * stream.Normal();
    Eigen::MatrixXd cut = row;
    const auto reached = static_cast<Eigen::Index>(16 * stream.Uniform());
    cut.rightCols(16 - reached).setConstant(kNaN);
    EXPECT_LE(likelihood->LogLikelihood(row)[0], likelihood->LogLikelihoodBound(cut)[0] + 1e-9);
    EXPECT_NEAR(likelihood->ReachedLogLikelihood(cut)[0],
                likelihood->Increments(row).row(0).head(reached).sum(), 1e-9);
    EXPECT_EQ(likelihood->LogLikelihood(cut)[0], reached == 16
                                                     ? likelihood->LogLikelihood(row)[0]
                                                     : -std::numeric_limits<double>::infinity());
  }
}

TEST(ModelError, BadOnesAreRefusedInASentence) {
  const auto refused = [](std::vector<ModelError> errors) {
    DataSet data = TwoCurves();
    data.model_errors = std::move(errors);
    return std::string(GaussianLikelihood::Create(data, NoiseMode::kModelError).status().message());
  };
  EXPECT_EQ(refused({{.relative = kUniformSd}}), "a model error has no members.");
  EXPECT_EQ(refused({{.members = {{0, 0}}}}), "a model error is neither relative nor absolute.");
  EXPECT_EQ(refused({{.members = {{0, 0}}, .relative = kUniformSd},
                     {.members = {{0, 0}}, .relative = kUniformSd}}),
            "observable 0 of experiment 0 stands in two model errors.");
  EXPECT_EQ(refused({{.members = {{0, 0}},
                      .absolute = ErrorScale{.prior = {.kind = PriorKind::kNormal}}}}),
            "the prior of a model error begins at -inf; a standard deviation is not negative.");
}

// y = a + b t with errors of 0.05 and a model error of sigma beside.
struct Line {
  std::vector<Prior> priors{{.kind = PriorKind::kNormal, .mean = 2, .sd = 1},
                            {.kind = PriorKind::kNormal, .mean = 0, .sd = 1}};
  DataSet data{};
  double sigma = 0;
  Eigen::RowVector2d truth;

  Line(int readings, PhiloxStream& stream) {
    sigma = kUniformSd.prior.Quantile(stream.Uniform());
    truth << 2 + stream.Normal(), stream.Normal();
    const Eigen::RowVectorXd exact = Predict(readings, truth);
    for (int t = 0; t < readings; ++t) {
      const double value = exact[t] + std::hypot(0.05, sigma) * stream.Normal();
      data.readings.push_back({.load_step = t, .value = value, .sd = 0.05});
    }
    data.model_errors = {{.members = {{0, 0}}, .absolute = kUniformSd}};
  }
  static Eigen::MatrixXd Predict(int readings, const Eigen::MatrixXd& p) {
    Eigen::MatrixXd rows(p.rows(), readings);
    for (int t = 0; t < readings; ++t) {
      rows.col(t) = p.col(0) + p.col(1) * (static_cast<double>(t) / readings);
    }
    return rows;
  }
};

// Mean, sd and evidence of a model that is linear given sigma: closed form at each of many sigma.
struct Expected {
  double log_evidence = 0;
  Eigen::Vector2d mean, sd;
  double sigma_mean = 0, sigma_sd = 0;
};
Expected ByQuadrature(const Line& line) {
  const auto n = static_cast<int>(line.data.readings.size());
  constexpr int kNodes = 4000;
  std::vector<double> logs;
  std::vector<LinearModel> models;
  const Eigen::MatrixXd design = Line::Predict(n, Eigen::Matrix2d::Identity()).transpose();
  for (const double sigma : Nodes(kUniformSd, kNodes)) {
    LinearModel model(n, 2, 1, 0);
    model.design = design;
    model.priors = line.priors;
    for (int t = 0; t < n; ++t) {
      model.values[t] = line.data.readings[static_cast<std::size_t>(t)].value;
      model.sd[t] = std::hypot(0.05, sigma);
    }
    logs.push_back(model.LogEvidence());
    models.push_back(std::move(model));
  }
  const Eigen::Map<const Eigen::VectorXd> all(logs.data(), kNodes);
  Expected expected;
  expected.log_evidence = LogSumExp(all) - std::log(double{kNodes});
  const Eigen::VectorXd weight = NormalizedLogWeights(all).array().exp();
  const std::vector<double> sigmas = Nodes(kUniformSd, kNodes);
  expected.mean.setZero();
  Eigen::Vector2d square = Eigen::Vector2d::Zero();
  double sigma_square = 0;
  for (int k = 0; k < kNodes; ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (weight[k] < 1e-12) continue;
    const Eigen::Vector2d mean = models[at].PosteriorMean();
    expected.mean += weight[k] * mean;
    square += weight[k] * (mean.cwiseAbs2() + models[at].PosteriorCovariance().diagonal());
    expected.sigma_mean += weight[k] * sigmas[at];
    sigma_square += weight[k] * sigmas[at] * sigmas[at];
  }
  expected.sd = (square - expected.mean.cwiseAbs2()).cwiseSqrt();
  expected.sigma_sd = std::sqrt(sigma_square - expected.sigma_mean * expected.sigma_mean);
  return expected;
}

void ExpectClose(const std::vector<ParameterSummary>& parameters, double log_evidence,
                 const std::vector<ModelErrorSummary>& errors, const Expected& expected) {
  for (int j = 0; j < 2; ++j) {
    const ParameterSummary& p = parameters[static_cast<std::size_t>(j)];
    EXPECT_NEAR((p.mean - expected.mean[j]) / expected.sd[j], 0, 0.15) << j;
    EXPECT_NEAR(p.sd / expected.sd[j], 1, 0.12) << j;
  }
  EXPECT_NEAR(log_evidence, expected.log_evidence, 0.15);
  ASSERT_EQ(errors.size(), 1U);
  ASSERT_TRUE(errors[0].absolute && !errors[0].relative);
  EXPECT_NEAR(errors[0].absolute->mean, expected.sigma_mean, 0.15 * expected.sigma_sd);
  EXPECT_NEAR(errors[0].absolute->sd / expected.sigma_sd, 1, 0.12);
  EXPECT_LT(errors[0].absolute->q05, errors[0].absolute->q50);
  EXPECT_LT(errors[0].absolute->q50, errors[0].absolute->q95);
}

TEST(ModelError, FilterAndEmulatorFindTheClosedForm) {
  PhiloxStream stream({.seed = 12});
  const Line line(20, stream);
  const Expected expected = ByQuadrature(line);
  const auto predict = [](const Eigen::MatrixXd& p) { return Line::Predict(20, p); };
  FilterOptions options{.noise = NoiseMode::kModelError, .seed = 3};
  const auto iterations = RunIterations(line.priors, line.data, options, 3, 800, predict);
  const auto posterior = ComputePosterior(line.priors, line.data, options, iterations);
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_EQ(posterior->degeneracy, "");
  EXPECT_FALSE(posterior->predictive_p.has_value()) << "the model error explains every misfit";
  ExpectClose(posterior->parameters, posterior->log_evidence, posterior->model_errors, expected);

  const auto few = RunIterations(line.priors, line.data, options, 2, 30, predict);
  const auto emulated = EmulatedPosterior(
      line.priors, line.data,
      {.noise = NoiseMode::kModelError, .draws = 4000, .path_draws = 200, .seed = 4}, few);
  ASSERT_TRUE(emulated.ok()) << emulated.status();
  EXPECT_TRUE(emulated->adequate) << emulated->reason;
  ExpectClose(emulated->parameters, emulated->log_evidence, emulated->model_errors, expected);
  EXPECT_NEAR(emulated->path.log_evidence[19], expected.log_evidence, 0.5);
}

// Simulation-based calibration [Talts et al. 2018]: the distribution function of the posterior at
// the truth is uniform. Of weights that have collapsed it is not; four iterations leave few of
// them. CALIB_TRIALS: trials of fresh seeds in twenty bins.
TEST(ModelError, TruthIsUniformUnderThePosterior) {
  const char* asked = std::getenv("CALIB_TRIALS");
  const int trials = asked != nullptr ? std::atoi(asked) : 100;
  const int bins = asked != nullptr ? 20 : 10;
  const char* fresh = std::getenv("CALIB_SEED");
  const std::uint64_t seed = fresh != nullptr ? std::strtoull(fresh, nullptr, 10) : 77;
  std::vector<std::vector<int>> counts(3, std::vector<int>(static_cast<std::size_t>(bins), 0));
  int collapsed = 0;
  for (int trial = 0; trial < trials; ++trial) {
    PhiloxStream stream({.seed = seed, .sample = static_cast<std::uint64_t>(trial)});
    const Line line(8, stream);
    const FilterOptions options{.noise = NoiseMode::kModelError,
                                .seed = seed + static_cast<std::uint64_t>(trial)};
    const auto predict = [](const Eigen::MatrixXd& p) { return Line::Predict(8, p); };
    const auto iterations = RunIterations(line.priors, line.data, options, 4, 300, predict);
    const auto posterior = ComputePosterior(line.priors, line.data, options, iterations);
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    collapsed += posterior->degeneracy.empty() ? 0 : 1;
    const auto likelihood = GaussianLikelihood::Create(line.data, NoiseMode::kModelError);
    Eigen::Vector3d below = Eigen::Vector3d::Zero();
    Eigen::Index row = 0;
    for (const Iteration& iteration : iterations) {
      const auto levels = likelihood->ModelErrors(iteration.predictions).front();
      for (Eigen::Index i = 0; i < iteration.parameters.rows(); ++i, ++row) {
        const double weight = std::exp(posterior->log_weights[row]);
        for (int j = 0; j < 2; ++j) {
          if (iteration.parameters(i, j) < line.truth[j]) below[j] += weight;
        }
        const Eigen::VectorXd p = NormalizedLogWeights(levels.log_joint.row(i)).array().exp();
        for (Eigen::Index k = 0; k < p.size(); ++k) {
          const ErrorCell& cell = levels.cells.AbsoluteOf(k);
          below[2] += weight * p[k] *
                      std::clamp((line.sigma - cell.low) / (cell.high - cell.low), 0.0, 1.0);
        }
      }
    }
    for (int j = 0; j < 3; ++j) {
      ++counts[static_cast<std::size_t>(j)][static_cast<std::size_t>(
          std::clamp(static_cast<int>(below[j] * bins), 0, bins - 1))];
    }
  }
  EXPECT_LT(collapsed, 0.1 * trials);
  for (std::size_t j = 0; j < counts.size(); ++j) {
    const double expected = static_cast<double>(trials) / bins;
    double chi_squared = 0;
    for (const int one : counts[j]) chi_squared += (one - expected) * (one - expected) / expected;
    const double p = GammaQInDouble(0.5 * (bins - 1), 0.5 * chi_squared);
    std::cout << (j == 2 ? "model error" : "parameter") << ": p " << p << " of " << trials
              << " trials in " << bins << " bins\n";
    EXPECT_GT(p, 1e-4);
  }
}

}  // namespace
}  // namespace calib::inference
