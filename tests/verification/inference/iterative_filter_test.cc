// The iterative filter on a linear model whose posterior and evidence are known in closed form.

#include "inference/filter/iterative_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

double LargestMeanError(const Posterior& posterior, const LinearModel& model) {
  const Eigen::VectorXd mean = model.PosteriorMean();
  const Eigen::MatrixXd covariance = model.PosteriorCovariance();
  double largest = 0;
  for (Eigen::Index j = 0; j < mean.size(); ++j) {
    largest = std::max(
        largest, std::abs(posterior.parameters[j].mean - mean[j]) / std::sqrt(covariance(j, j)));
  }
  return largest;
}

// Four standard errors of n effective draws of a normal: beyond them a sound estimate lies once in
// 16 000 times. Of the mean, in units of the sd: 1 / sqrt(n); of the sd, relative: 1 / sqrt(2 n).
constexpr double kSigmas = 4;
double MeanLimit(const Posterior& posterior) { return kSigmas / std::sqrt(posterior.ess); }
double SdLimit(const Posterior& posterior) { return kSigmas / std::sqrt(2 * posterior.ess); }

double LargestSdError(const Posterior& posterior, const LinearModel& model) {
  const Eigen::MatrixXd covariance = model.PosteriorCovariance();
  double largest = 0;
  for (Eigen::Index j = 0; j < covariance.rows(); ++j) {
    largest =
        std::max(largest, std::abs(posterior.parameters[j].sd / std::sqrt(covariance(j, j)) - 1));
  }
  return largest;
}

// The data count once: the posterior after one, two, three and four iterations is the same one,
// only known better. With the proposal forgotten, as in weights that start equal, the sd would
// shrink like 1/sqrt(k): 30 % at two iterations.
TEST(IterativeFilter, PosteriorAfterAnyIterationIsThePosteriorOfTheDataCountedOnce) {
  const LinearModel model(12, 2, 1.0, 11);
  const FilterOptions options{.seed = 5};
  const auto iterations = RunIterations(model.priors, model.Data(), options, 4, 1000,
                                        [&](const Eigen::MatrixXd& p) { return model.Predict(p); });
  for (std::size_t count = 1; count <= 4; ++count) {
    const auto posterior =
        ComputePosterior(model.priors, model.Data(), options, std::span(iterations).first(count));
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    EXPECT_LE(LargestMeanError(*posterior, model), MeanLimit(*posterior)) << count << " iterations";
    EXPECT_LE(LargestSdError(*posterior, model), SdLimit(*posterior)) << count << " iterations";
    EXPECT_LE(std::abs(posterior->log_evidence - model.LogEvidence()),
              4 * posterior->log_evidence_se);
    EXPECT_EQ(posterior->degeneracy, "");
  }
}

// A posterior far smaller than the prior, five parameters: tempering brings the proposal there in a
// few iterations.
TEST(IterativeFilter, SmallPosteriorIsReachedByTempering) {
  const LinearModel model(20, 5, 0.1, 2);
  const FilterOptions options{.seed = 3};
  const auto iterations = RunIterations(model.priors, model.Data(), options, 8, 300,
                                        [&](const Eigen::MatrixXd& p) { return model.Predict(p); });
  const auto first =
      ComputePosterior(model.priors, model.Data(), options, std::span(iterations).first(1));
  EXPECT_LT(first->ess, 5);
  EXPECT_THAT(first->degeneracy, testing::HasSubstr("do not make a posterior"));
  const auto last = ComputePosterior(model.priors, model.Data(), options, iterations);
  EXPECT_EQ(last->degeneracy, "");  // at least 50 effective samples, Pareto index at most 0.7
  EXPECT_LE(LargestMeanError(*last, model), MeanLimit(*last));
  EXPECT_LE(LargestSdError(*last, model), SdLimit(*last));
  EXPECT_NEAR(last->log_evidence, model.LogEvidence(), kSigmas * last->log_evidence_se);
  EXPECT_LT(last->log_evidence_se, 0.15);  // what 50 effective samples would give is 1 / sqrt(50)
}

// Log-uniform prior and a posterior at its bound: truncation is redrawn and renormalised. Known by
// quadrature.
TEST(IterativeFilter, PosteriorAtABoundOfALogPrior) {
  const std::vector<Prior> priors{{.kind = PriorKind::kLogUniform, .min = 1, .max = 100}};
  DataSet data;
  data.readings.push_back({.value = 0.5, .sd = 0.6});
  const FilterOptions options{.seed = 8};
  const auto iterations =
      RunIterations(priors, data, options, 3, 1000, [](const Eigen::MatrixXd& p) { return p; });
  const auto posterior = ComputePosterior(priors, data, options, iterations);
  double mass = 0;
  double first = 0;
  double second = 0;
  constexpr int kCells = 200000;
  for (int i = 0; i < kCells; ++i) {
    const double x = std::pow(100, (i + 0.5) / kCells);
    const double weight = std::exp(-0.5 * std::pow((x - 0.5) / 0.6, 2)) /
                          (kCells * 0.6 * std::sqrt(2 * std::numbers::pi));
    mass += weight;
    first += weight * x;
    second += weight * x * x;
  }
  const double mean = first / mass;
  const double sd = std::sqrt(second / mass - mean * mean);
  EXPECT_NEAR(posterior->log_evidence, std::log(mass), kSigmas * posterior->log_evidence_se);
  EXPECT_GT(posterior->ess, 1000);  // a third of the samples: the proposal has found the bound
  EXPECT_NEAR(posterior->parameters[0].mean, mean, MeanLimit(*posterior) * sd);
  // At its bound the posterior is nearly half a normal, whose kurtosis of 3.9 makes the standard
  // error of the sd sqrt((3.9 - 1) / (4 n)), 1.2 times that of a normal.
  EXPECT_NEAR(posterior->parameters[0].sd, sd, 1.2 * SdLimit(*posterior) * sd);
  EXPECT_TRUE(posterior->parameters[0].at_bound);
  EXPECT_GT(iterations[2].parameters.minCoeff(), 1);
}

// Each proposal integrates to one: the mean of proposal / prior over prior draws.
TEST(IterativeFilter, ProposalDensityIsNormalised) {
  std::vector<Prior> priors{{.kind = PriorKind::kLogUniform, .min = 1, .max = 100},
                            {.kind = PriorKind::kUniform, .min = -1, .max = 1},
                            {.kind = PriorKind::kNormal, .min = 0, .mean = 0, .sd = 1}};
  DataSet data;
  data.readings.push_back({.value = 1.0, .sd = 2});
  data.readings.push_back({.load_step = 1, .value = 0.9, .sd = 0.3});
  data.readings.push_back({.load_step = 2, .value = 0.5, .sd = 0.5});
  const FilterOptions options{.design = Design::kSobol, .seed = 8};
  const auto iterations =
      RunIterations(priors, data, options, 2, 500, [](const Eigen::MatrixXd& p) { return p; });
  ASSERT_LT(iterations[1].proposal.log_acceptance, -0.1) << "the mixture should overlap the bounds";
  const Eigen::MatrixXd points = DrawSamples({}, priors, options, 0, 1 << 15).value();
  const Eigen::VectorXd ratio =
      (LogDensity(iterations[1].proposal, priors, points) - LogDensity({}, priors, points))
          .array()
          .exp();
  EXPECT_NEAR(ratio.mean(), 1, 0.003);
}

// Inferred noise: y_t = theta + e with the stated sd wrong by 2; the marginal posterior of theta by
// quadrature.
TEST(IterativeFilter, InferredNoiseGivesTheStudentPosterior) {
  const std::vector<Prior> priors{{.kind = PriorKind::kUniform, .min = -5, .max = 5}};
  DataSet data;
  PhiloxStream stream({.seed = 21});
  for (int t = 0; t < 10; ++t) {
    data.readings.push_back({.load_step = t, .value = 1 + stream.Normal(), .sd = 0.5});
  }
  const FilterOptions options{.noise = NoiseMode::kInferred, .seed = 4};
  const auto predict = [](const Eigen::MatrixXd& p) { return Eigen::MatrixXd(p.replicate(1, 10)); };
  const auto iterations = RunIterations(priors, data, options, 2, 1000, predict);
  const auto posterior = ComputePosterior(priors, data, options, iterations);
  double mass = 0;
  double first = 0;
  double second = 0;
  constexpr int kCells = 20000;
  for (int i = 0; i < kCells; ++i) {
    const double theta = -5 + 10 * (i + 0.5) / kCells;
    double squares = 0;
    for (const Reading& r : data.readings) squares += std::pow((r.value - theta) / r.sd, 2);
    // Inverse gamma (1/2, 1/2) factor: a t density, up to what does not depend on theta.
    const double weight = std::pow(0.5 + 0.5 * squares, -5.5);
    mass += weight;
    first += weight * theta;
    second += weight * theta * theta;
  }
  const double mean = first / mass;
  const double sd = std::sqrt(second / mass - mean * mean);
  EXPECT_NEAR(posterior->parameters[0].mean, mean, MeanLimit(*posterior) * sd);
  // Student t of 10 degrees of freedom: kurtosis 4, so sqrt(3 / 2) of a normal's error.
  EXPECT_NEAR(posterior->parameters[0].sd, sd, std::sqrt(1.5) * SdLimit(*posterior) * sd);
  const double log_constant = 0.5 * std::log(0.5) - std::lgamma(0.5) + std::lgamma(5.5) -
                              5 * std::log(2 * std::numbers::pi) - 10 * std::log(0.5);
  EXPECT_NEAR(posterior->log_evidence, std::log(mass / kCells) + log_constant,
              kSigmas * posterior->log_evidence_se);
}

// Samples from a table with their own density: importance weights correct for it.
TEST(IterativeFilter, RunsMadeElsewhereUseTheirOwnDensity) {
  const LinearModel model(6, 1, 1.0, 7);
  const Prior& prior = model.priors[0];
  Iteration iteration;
  iteration.parameters.resize(4000, 1);
  iteration.log_proposal.emplace(4000);
  PhiloxStream stream({.seed = 1});
  for (int i = 0; i < 4000; ++i) {
    const double z = 1.5 * stream.Normal() + 0.5;
    iteration.parameters(i, 0) = prior.mean + prior.sd * z;
    (*iteration.log_proposal)[i] = -0.5 * std::pow((z - 0.5) / 1.5, 2) -
                                   std::log(1.5 * prior.sd * std::sqrt(2 * std::numbers::pi));
  }
  iteration.predictions = model.Predict(iteration.parameters);
  const auto posterior = ComputePosterior(model.priors, model.Data(), {}, std::span(&iteration, 1));
  EXPECT_LE(LargestMeanError(*posterior, model), MeanLimit(*posterior));
  EXPECT_LE(LargestSdError(*posterior, model), SdLimit(*posterior));
  EXPECT_NEAR(posterior->log_evidence, model.LogEvidence(), kSigmas * posterior->log_evidence_se);
}

}  // namespace
}  // namespace calib::inference
