#include "inference/tmcmc/tmcmc.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>
#include <vector>

#include "inference/tmcmc/tempering_step.h"

namespace calib::inference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::vector<Prior> UnitSquare() {
  return std::vector<Prior>(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
}

double Peak(double x, double y) {
  const double a = (x - 0.3) / 0.05;
  const double b = (y - 0.6) / 0.1;
  return -0.5 * (a * a + b * b);
}

Eigen::VectorXd PeakOfRows(const Eigen::MatrixXd& rows) {
  Eigen::VectorXd result(rows.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i) result[i] = Peak(rows(i, 0), rows(i, 1));
  return result;
}

// One normal in standardised coordinates, cut off at the square, and a share of the prior.
Proposal About(const JointPrior& priors, double x, double y, double sd, double prior_share) {
  Proposal proposal;
  proposal.components.push_back({.weight = 1,
                                 .mean = priors.ToStandard(Eigen::Vector2d(x, y)),
                                 .covariance = sd * sd * Eigen::Matrix2d::Identity()});
  proposal.defensive_share = prior_share;
  proposal.log_acceptance = LogMassInSupport(proposal.components, priors);
  return proposal;
}

TEST(TemperingStep, ReachesTheVariationWanted) {
  Eigen::VectorXd log_likelihood(200);
  for (int i = 0; i < 200; ++i) log_likelihood[i] = -0.1 * i;
  const TemperingStep step = NextExponent(log_likelihood, 0.25, 0.5);
  EXPECT_GT(step.exponent, 0.25);
  EXPECT_LT(step.exponent, 1);
  EXPECT_NEAR(step.cv, 0.5, 1e-9);
  EXPECT_NEAR(step.weights.sum(), 1, 1e-12);
}

TEST(TemperingStep, GoesToOneWhenTheLikelihoodIsFlat) {
  const TemperingStep step = NextExponent(Eigen::VectorXd::Constant(50, -3.0), 0.2, 0.5);
  EXPECT_EQ(step.exponent, 1);
  EXPECT_NEAR(step.log_mean_weight, -3 * 0.8, 1e-12);
}

TEST(TemperingStep, DivergedSamplesWeighNothingAndLowerTheEvidence) {
  Eigen::VectorXd log_likelihood = Eigen::VectorXd::Zero(100);
  log_likelihood.head(50).setConstant(-kInfinity);
  const TemperingStep step = NextExponent(log_likelihood, 0, 0.5);
  EXPECT_EQ(step.exponent, 1);
  EXPECT_EQ(step.weights[0], 0);
  EXPECT_NEAR(step.log_mean_weight, std::log(0.5), 1e-12);
}

TEST(TemperingStep, FactorReproducesTheWeightedCovariance) {
  Eigen::MatrixXd rows(4, 2);
  rows << 0, 0, 1, 2, 2, 1, 4, 4;
  const Eigen::Vector4d weights(0.1, 0.2, 0.3, 0.4);
  const Eigen::RowVector2d mean = weights.transpose() * rows;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (int i = 0; i < 4; ++i)
    covariance += weights[i] * (rows.row(i) - mean).transpose() * (rows.row(i) - mean);
  const Eigen::MatrixXd factor = WeightedCovarianceFactor(rows, weights);
  EXPECT_LT((factor * factor.transpose() - covariance).norm(), 1e-12);
}

TEST(TemperingStep, APopulationOnALineCanStillMoveAcrossIt) {
  Eigen::MatrixXd rows(3, 2);
  rows << 0, 0, 1, 1, 2, 2;
  const Eigen::MatrixXd factor = WeightedCovarianceFactor(rows, Eigen::Vector3d::Constant(1.0 / 3));
  EXPECT_GT(factor(1, 1), 0);
  EXPECT_TRUE(factor.allFinite());
}

TEST(Tmcmc, SameSeedSameBitsAndAnotherSeedOthers) {
  const auto priors = UnitSquare();
  const auto first = RunTmcmc(priors, {.samples = 200, .seed = 5}, PeakOfRows);
  const auto again = RunTmcmc(priors, {.samples = 200, .seed = 5}, PeakOfRows);
  const auto other = RunTmcmc(priors, {.samples = 200, .seed = 6}, PeakOfRows);
  ASSERT_TRUE(first.ok() && again.ok() && other.ok());
  EXPECT_EQ(first->samples, again->samples);
  EXPECT_EQ(first->log_evidence, again->log_evidence);
  EXPECT_NE(first->log_evidence, other->log_evidence);
}

TEST(Tmcmc, GoesOnFromACopyOfItsState) {
  const auto priors = UnitSquare();
  const TmcmcOptions options{.samples = 100, .steps = 3, .seed = 1};
  const auto whole = RunTmcmc(priors, options, PeakOfRows);
  ASSERT_TRUE(whole.ok());
  auto state = StartTmcmc(priors, options);
  ASSERT_TRUE(state.ok());
  while (!state->finished()) {
    const TmcmcState stored = *state;  // as if read back from a store by another process
    TmcmcState resumed = stored;
    ASSERT_TRUE(AdvanceTmcmc(priors, options, PeakOfRows(resumed.proposals), resumed).ok());
    *state = resumed;
  }
  EXPECT_EQ(state->samples, whole->samples);
  EXPECT_EQ(state->log_evidence, whole->log_evidence);
}

// A run stopped because its likelihood stays below accept_above reports -inf, and nothing changes.
TEST(Tmcmc, ThresholdsOfAcceptanceAreExact) {
  const auto priors = UnitSquare();
  const TmcmcOptions options{.samples = 100, .steps = 3, .seed = 1};
  const auto whole = RunTmcmc(priors, options, PeakOfRows);
  ASSERT_TRUE(whole.ok());
  auto state = StartTmcmc(priors, options);
  ASSERT_TRUE(state.ok());
  int stopped = 0;
  while (!state->finished()) {
    Eigen::VectorXd log_likelihood = PeakOfRows(state->proposals);
    for (Eigen::Index i = 0; i < log_likelihood.size(); ++i) {
      if (log_likelihood[i] > state->accept_above[i]) continue;
      log_likelihood[i] = -kInfinity;
      ++stopped;
    }
    ASSERT_TRUE(AdvanceTmcmc(priors, options, log_likelihood, *state).ok());
  }
  EXPECT_GT(stopped, 0);
  EXPECT_EQ(state->samples, whole->samples);
  EXPECT_EQ(state->log_evidence, whole->log_evidence);
}

// The peak of PeakOfRows lies within the square up to 1e-4 of its mass. q: on the peak, far from it
// and cut off by two sides of the square, far from it without a share of the prior.
TEST(Tmcmc, FromAnotherDensityToTheSamePosteriorAndEvidence) {
  const JointPrior priors = UnitSquare();
  const double evidence = std::log(2 * std::numbers::pi * 0.05 * 0.1);
  const auto from_prior = RunTmcmc(priors, {.samples = 1000, .seed = 1}, PeakOfRows);
  ASSERT_TRUE(from_prior.ok());
  for (const Proposal& q : {About(priors, 0.3, 0.6, 0.3, 0.5), About(priors, 0.95, 0.05, 0.3, 0.5),
                            About(priors, 0.95, 0.05, 0.3, 0.01), About(priors, 0.8, 0.2, 1, 0)}) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      const auto state = RunTmcmc(priors, {.samples = 1000, .seed = seed, .first = q}, PeakOfRows);
      ASSERT_TRUE(state.ok()) << state.status();
      // Four standard errors of as many independent draws as every tenth is; log_acceptance is
      // known to 1e-3.
      const double few = 4 / std::sqrt(100.0);
      EXPECT_NEAR(state->log_evidence, evidence, 4 * state->LogEvidenceStandardError() + 2e-3);
      EXPECT_LT(state->LogEvidenceStandardError(), 0.2);
      for (const auto& [j, mean, sd] : {std::tuple{0, 0.3, 0.05}, std::tuple{1, 0.6, 0.1}}) {
        const Eigen::ArrayXd x = state->samples.col(j);
        EXPECT_NEAR(x.mean(), mean, few * sd);
        EXPECT_NEAR(std::sqrt((x - x.mean()).square().mean()), sd, few * sd / std::sqrt(2.0));
      }
    }
  }
  const auto on_the_peak = RunTmcmc(
      priors, {.samples = 1000, .seed = 1, .first = About(priors, 0.3, 0.6, 0.3, 0.5)}, PeakOfRows);
  ASSERT_TRUE(on_the_peak.ok());
  EXPECT_LT(on_the_peak->stages.size(), from_prior->stages.size()) << "a shorter way";
}

TEST(Tmcmc, FromThePriorAsAFirstProposalTheBitsAreThoseOfThePrior) {
  const JointPrior priors = UnitSquare();
  const auto plain = RunTmcmc(priors, {.samples = 200, .seed = 5}, PeakOfRows);
  const auto all_prior = RunTmcmc(
      priors, {.samples = 200, .seed = 5, .first = About(priors, 0.9, 0.1, 0.1, 1)}, PeakOfRows);
  ASSERT_TRUE(plain.ok() && all_prior.ok());
  EXPECT_EQ(all_prior->samples, plain->samples);
  EXPECT_EQ(all_prior->log_likelihood, plain->log_likelihood);
  EXPECT_EQ(all_prior->origin, plain->origin);
  EXPECT_EQ(all_prior->log_evidence, plain->log_evidence);
  EXPECT_TRUE((plain->log_importance.array() == 0).all());
}

TEST(Tmcmc, FromAnotherDensityItGoesOnFromACopyAndStopsExactly) {
  const JointPrior priors = UnitSquare();
  const TmcmcOptions options{
      .samples = 100, .steps = 3, .seed = 1, .first = About(priors, 0.5, 0.5, 0.3, 0.5)};
  const auto whole = RunTmcmc(priors, options, PeakOfRows);
  ASSERT_TRUE(whole.ok());
  auto state = StartTmcmc(priors, options);
  ASSERT_TRUE(state.ok());
  while (!state->finished()) {
    TmcmcState resumed = *state;
    Eigen::VectorXd log_likelihood = PeakOfRows(resumed.proposals);
    for (Eigen::Index i = 0; i < log_likelihood.size(); ++i) {
      if (!(log_likelihood[i] > resumed.accept_above[i])) log_likelihood[i] = -kInfinity;
    }
    ASSERT_TRUE(AdvanceTmcmc(priors, options, log_likelihood, resumed).ok());
    *state = resumed;
  }
  EXPECT_EQ(state->samples, whole->samples);
  EXPECT_EQ(state->log_evidence, whole->log_evidence);
}

TEST(Tmcmc, NeverEvaluatesOutsideThePrior) {
  const auto priors = UnitSquare();
  const auto at_the_corner = [](const Eigen::MatrixXd& rows) {
    EXPECT_GE(rows.minCoeff(), 0);
    EXPECT_LE(rows.maxCoeff(), 1);
    return Eigen::VectorXd(-30 * rows.rowwise().sum());
  };
  const auto state = RunTmcmc(priors, {.samples = 300, .seed = 2}, at_the_corner);
  ASSERT_TRUE(state.ok());
  EXPECT_GE(state->samples.minCoeff(), 0);
}

TEST(Tmcmc, DivergedRunsCountAsImpossible) {
  const auto priors = UnitSquare();
  const auto half = [](const Eigen::MatrixXd& rows) {
    Eigen::VectorXd result = Eigen::VectorXd::Zero(rows.rows());
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      if (rows(i, 0) > 0.5) result[i] = kNaN;
    }
    return result;
  };
  const auto state = RunTmcmc(priors, {.samples = 1000, .seed = 3}, half);
  ASSERT_TRUE(state.ok());
  EXPECT_LE(state->samples.col(0).maxCoeff(), 0.5);
  EXPECT_NEAR(state->log_evidence, std::log(0.5), 0.1);
}

TEST(Tmcmc, SaysWhatIsWrong) {
  const auto priors = UnitSquare();
  EXPECT_EQ(StartTmcmc(priors, {.samples = 3}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(StartTmcmc(priors, {.target_cv = 0}).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(StartTmcmc({}, {}).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(StartTmcmc(priors, {.first = About(priors, 0.5, 0.5, 1, 1.5)}).status().code(),
            absl::StatusCode::kInvalidArgument);
  Proposal holding;
  holding.frozen = {0.5, std::nullopt};
  EXPECT_EQ(StartTmcmc(priors, {.first = holding}).status().code(),
            absl::StatusCode::kInvalidArgument);
  Proposal outside = About(priors, 0.5, 0.5, 0.1, 0.5);
  outside.components[0].mean[0] = 9;
  outside.log_acceptance = LogMassInSupport(outside.components, priors);
  EXPECT_EQ(StartTmcmc(priors, {.first = outside}).status().code(),
            absl::StatusCode::kFailedPrecondition);
  const auto diverged = [](const Eigen::MatrixXd& rows) {
    return Eigen::VectorXd(Eigen::VectorXd::Constant(rows.rows(), kNaN));
  };
  EXPECT_EQ(RunTmcmc(priors, {.samples = 50}, diverged).status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(RunTmcmc(priors, {.samples = 50, .max_stages = 1}, PeakOfRows).status().code(),
            absl::StatusCode::kFailedPrecondition);
  auto state = StartTmcmc(priors, {.samples = 50});
  ASSERT_TRUE(state.ok());
  EXPECT_EQ(AdvanceTmcmc(priors, {.samples = 50}, Eigen::VectorXd::Zero(7), *state).code(),
            absl::StatusCode::kInvalidArgument);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(RunTmcmc(priors, {}, PeakOfRows, stop.get_token()).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace calib::inference
