// Parameters held on the way, and the path presented backwards, against closed forms. Limits: four
// standard errors of the estimate itself.

#include <gtest/gtest.h>

#include <boost/math/special_functions/beta.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <numbers>
#include <optional>

#include "inference/data/gaussian_likelihood.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/sampling/halton.h"
#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

constexpr double kSigmas = 4;

// The model given the value of one parameter: another linear model with one parameter less.
LinearModel Given(const LinearModel& model, int held, double value) {
  LinearModel rest = model;
  const Eigen::Index d = model.design.cols();
  rest.values = model.values - model.design.col(held) * value;
  rest.design.resize(model.design.rows(), d - 1);
  rest.priors.clear();
  Eigen::Index column = 0;
  for (Eigen::Index j = 0; j < d; ++j) {
    if (j == held) continue;
    rest.design.col(column++) = model.design.col(j);
    rest.priors.push_back(model.priors[static_cast<std::size_t>(j)]);
  }
  return rest;
}

struct HeldRun {
  LinearModel model{9, 3, 0.5, 21};
  FilterOptions options{.design = Design::kSobol, .seed = 4};
  std::vector<Iteration> iterations;
  double value = 0;

  HeldRun() {
    const DataSet data = model.Data();
    iterations = RunIterations(model.priors, data, options, 2, 600,
                               [&](const Eigen::MatrixXd& p) { return model.Predict(p); });
    value = ComputePosterior(model.priors, data, options, iterations)->parameters[1].mean;
    for (int k = 2; k < 4; ++k) {
      Iteration iteration;
      iteration.proposal =
          FitProposal(model.priors, data, options, iterations, {std::nullopt, value, std::nullopt})
              .value();
      iteration.parameters = DrawSamples(iteration.proposal, model.priors, options, k, 600).value();
      iteration.predictions = model.Predict(iteration.parameters);
      iterations.push_back(std::move(iteration));
    }
  }
};

TEST(HeldParameters, PosteriorAndEvidenceAreThoseGivenTheValue) {
  const HeldRun run;
  for (std::size_t k = 2; k < 4; ++k) {
    EXPECT_EQ((run.iterations[k].parameters.col(1).array() - run.value).abs().maxCoeff(), 0);
  }
  const auto posterior =
      ComputePosterior(run.model.priors, run.model.Data(), run.options, run.iterations);
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  const LinearModel rest = Given(run.model, 1, run.value);
  EXPECT_NEAR(posterior->log_evidence, rest.LogEvidence(), kSigmas * posterior->log_evidence_se);
  const Eigen::VectorXd mean = rest.PosteriorMean();
  const Eigen::VectorXd sd = rest.PosteriorCovariance().diagonal().cwiseSqrt();
  for (const int j : {0, 1}) {
    const ParameterSummary& p = posterior->parameters[j == 0 ? 0 : 2];
    EXPECT_NEAR(p.mean, mean[j], kSigmas * sd[j] / std::sqrt(posterior->ess));
    EXPECT_NEAR(p.sd / sd[j], 1, kSigmas / std::sqrt(2 * posterior->ess));
  }
  EXPECT_EQ(posterior->parameters[1].mean, run.value);
  EXPECT_TRUE(std::isnan(posterior->parameters[1].sd))
      << "what is held has no uncertainty to state";
  EXPECT_EQ(posterior->log_weights.head(1200).maxCoeff(), -std::numeric_limits<double>::infinity())
      << "samples elsewhere say nothing of the posterior given the value";
}

TEST(HeldParameters, TheEmulatorHoldsThemToo) {
  const HeldRun run;
  std::vector<Iteration> few;
  for (const Iteration& all : run.iterations) {
    few.push_back({.proposal = all.proposal,
                   .parameters = all.parameters.topRows(40),
                   .predictions = all.predictions.topRows(40),
                   .log_proposal = {}});
  }
  const auto result = EmulatedPosterior(run.model.priors, run.model.Data(), {.seed = 2}, few);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_TRUE(result->adequate) << result->reason;
  const LinearModel rest = Given(run.model, 1, run.value);
  EXPECT_NEAR(result->log_evidence, rest.LogEvidence(), kSigmas * result->log_evidence_se);
  EXPECT_EQ((result->draws.col(1).array() - run.value).abs().maxCoeff(), 0);
  EXPECT_NEAR(result->parameters[0].mean, rest.PosteriorMean()[0],
              kSigmas * std::sqrt(rest.PosteriorCovariance()(0, 0) / 200));
}

TEST(HeldParameters, RefusedWhereNothingWouldBeLeft) {
  const HeldRun run;
  const auto none =
      FitProposal(run.model.priors, run.model.Data(), run.options, run.iterations, {1.0, 1.0, 1.0});
  EXPECT_EQ(none.status().code(), absl::StatusCode::kInvalidArgument);
}

// Reversed, the first row is the posterior of the last reading alone, and the last row is the
// posterior.
TEST(ReversedPath, EndsInTheSamePosteriorWhateverTheErrors) {
  const LinearModel model(6, 2, 0.8, 5);
  for (const NoiseMode noise : {NoiseMode::kGiven, NoiseMode::kInferred}) {
    DataSet data = model.Data();
    for (std::size_t t = 0; t < data.readings.size(); ++t)
      data.readings[t].control = 0.1 * static_cast<double>(t * t + 1);
    data.correlations = {{.length = 0.4}};
    FilterOptions options{.noise = noise, .design = Design::kSobol, .seed = 1};
    options.reversed_path = true;
    const auto runs = RunIterations(model.priors, data, options, 1, 2000,
                                    [&](const Eigen::MatrixXd& p) { return model.Predict(p); });
    const auto posterior = ComputePosterior(model.priors, data, options, runs);
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    options.reversed_path = false;
    const auto forward = ComputePosterior(model.priors, data, options, runs);
    EXPECT_EQ(posterior->log_weights, forward->log_weights);
    EXPECT_EQ(posterior->log_evidence, forward->log_evidence);
    EXPECT_EQ(forward->reversed_path.load_step.size(), 0U);

    const Eigen::Index last = posterior->path.mean.rows() - 1;
    EXPECT_EQ(posterior->reversed_path.load_step.front(), 5);
    EXPECT_LT((posterior->path.mean.row(last) - posterior->reversed_path.mean.row(last)).norm(),
              1e-10);
    EXPECT_NEAR(posterior->path.log_evidence[last], posterior->reversed_path.log_evidence[last],
                1e-9);
    DataSet alone;
    alone.readings = {data.readings.back()};
    const Iteration one{.proposal = {},
                        .parameters = runs[0].parameters,
                        .predictions = runs[0].predictions.rightCols(1),
                        .log_proposal = {}};
    const auto of_last =
        ComputePosterior(model.priors, alone, options, std::vector<Iteration>{one});
    EXPECT_NEAR(posterior->reversed_path.mean(0, 0), of_last->parameters[0].mean, 1e-10);
  }
}

// One factor for all errors of two observables, inverse gamma prior: given theta everything is a
// multivariate t; a normal linear model with such a factor has a closed evidence too.
TEST(SharedNoise, NormalInverseGammaEvidenceAndFactor) {
  const LinearModel model(8, 2, 0.5, 9);
  DataSet data = model.Data();
  for (std::size_t t = 0; t < data.readings.size(); ++t)
    data.readings[t].observable = static_cast<int>(t % 2);
  const VarianceFactorPrior prior{.shape = 3, .rate = 2};
  data.noise_groups = {{.members = {{0, 0}, {0, 1}}, .prior = prior}};

  // theta | f ~ N(m, V), not scaled by f: integrate f numerically over N(y; A m, A V A^T + f S).
  const auto log_given = [&](double f) {
    LinearModel scaled = model;
    scaled.sd *= std::sqrt(f);
    return scaled.LogEvidence();
  };
  double evidence = 0;
  double first = 0;
  constexpr int kCells = 20000;
  for (int i = 0; i < kCells; ++i) {
    const double log_f = -6 + 12 * (i + 0.5) / kCells;
    const double f = std::exp(log_f);
    const double log_prior = prior.shape * std::log(prior.rate) - std::lgamma(prior.shape) -
                             (prior.shape + 1) * log_f - prior.rate / f;
    const double mass = std::exp(log_prior + log_f + log_given(f)) * 12 / kCells;
    evidence += mass;
    first += mass * log_f;
  }
  const FilterOptions options{.noise = NoiseMode::kInferred, .design = Design::kSobol, .seed = 3};
  const auto runs = RunIterations(model.priors, data, options, 3, 800,
                                  [&](const Eigen::MatrixXd& p) { return model.Predict(p); });
  const auto posterior = ComputePosterior(model.priors, data, options, runs);
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_NEAR(posterior->log_evidence, std::log(evidence), kSigmas * posterior->log_evidence_se);
  ASSERT_EQ(posterior->noise_scale.rows(), 1);
  // Median of sqrt(f) against exp(E ln f / 2): the law of ln f is all but symmetric, its skewness
  // moves the median of ln sqrt(f), whose sd is about 0.2, by less than a tenth of that; the
  // standard error of the median of a thousand draws is 0.008.
  EXPECT_NEAR(std::log(posterior->noise_scale(0, 1)), 0.5 * first / evidence, 0.04);

  const auto emulated =
      EmulatedPosterior(model.priors, data, {.noise = NoiseMode::kInferred, .seed = 3}, runs);
  ASSERT_TRUE(emulated.ok()) << emulated.status();
  ASSERT_TRUE(emulated->adequate) << emulated->reason;
  EXPECT_NEAR(emulated->log_evidence, std::log(evidence), kSigmas * emulated->log_evidence_se);
  EXPECT_NEAR(std::log(emulated->noise_scale(0, 1)), 0.5 * first / evidence, 0.02 + 4 * 0.008);
}

// A single sample of weight one: the predictive p-value is that of its chi-squared.
TEST(PredictiveP, OfOneSampleIsItsChiSquaredTail) {
  DataSet data;
  for (int t = 0; t < 5; ++t) data.readings.push_back({.load_step = t, .value = 0, .sd = 2});
  const std::vector<Prior> priors = {{.kind = PriorKind::kUniform, .min = 0, .max = 1}};
  Iteration one;
  one.parameters = Eigen::MatrixXd::Constant(1, 1, 0.5);
  one.predictions = Eigen::RowVectorXd::LinSpaced(5, 0, 4);  // chi^2 = 30 / 4
  const auto posterior = ComputePosterior(priors, data, {}, std::vector<Iteration>{one});
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_NEAR(*posterior->predictive_p, boost::math::gamma_q(2.5, 0.5 * 30 / 4), 1e-12);
  // Errors that three packings show: Fisher's law of 5 and 2 degrees of freedom at (30/4)/5.
  const KnownFrom packings{.readings = 5, .scatter = 5, .packings = 3};
  const auto few = ComputePosterior(priors, data, {}, std::vector<Iteration>{one}, packings);
  ASSERT_TRUE(few.ok()) << few.status();
  EXPECT_NEAR(*few->predictive_p, boost::math::ibeta(1, 2.5, 2 / (2 + 7.5)), 1e-12);
}

// Twins share their weight between the halves: no difference between the halves' means.
TEST(SplitHalf, OfTwinsIsZeroAndOfOppositesIsLarge) {
  DataSet data;
  data.readings.push_back({.value = 0, .sd = 1});
  const std::vector<Prior> priors = {{.kind = PriorKind::kUniform, .min = 0, .max = 1}};
  Iteration twins;
  twins.parameters = Eigen::Vector4d(0.2, 0.2, 0.8, 0.8);
  twins.predictions = Eigen::Vector4d(0.1, 0.1, 0.4, 0.4);
  Iteration opposites;  // one each
  opposites.parameters = Eigen::Vector2d(0.2, 0.8);
  opposites.predictions = Eigen::Vector2d::Zero();
  EXPECT_NEAR(ComputePosterior(priors, data, {}, std::vector<Iteration>{twins})->split_half[0], 0,
              1e-12);
  EXPECT_NEAR(ComputePosterior(priors, data, {}, std::vector<Iteration>{opposites})->split_half[0],
              2, 1e-12);
}

// Every second point of Halton's sequence lies above the middle of the first parameter.
TEST(SplitHalf, OfASequenceIsThatOfChance) {
  constexpr int kSamples = 4000;
  DataSet data;
  data.readings.push_back({.value = 0.5, .sd = 0.1});
  const std::vector<Prior> priors(2, {.kind = PriorKind::kUniform, .min = 0, .max = 1});
  Iteration sequence;
  sequence.parameters = Halton(kSamples, 2);
  sequence.predictions = sequence.parameters.col(0);
  const auto posterior = ComputePosterior(priors, data, {}, std::vector<Iteration>{sequence});
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_LT(posterior->split_half.maxCoeff(), 4 * 2 / std::sqrt(posterior->ess));
}

}  // namespace
}  // namespace calib::inference
