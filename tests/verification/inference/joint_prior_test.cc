// Correlated and constrained priors against closed forms, by every method. Limits are multiples of
// the standard errors that the methods state themselves: 4 of them for one fixed seed, beyond which
// a sound estimate lies once in 16 000 times.

#include "inference/prior/joint_prior.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "inference/data/gaussian_likelihood.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/filter/iterative_filter.h"
#include "inference/numerics/standard_normal.h"
#include "inference/tmcmc/tmcmc.h"
#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

constexpr double kSigmas = 4;

// y = A theta + e, e ~ N(0, s^2 I), theta ~ N(m, D R D).
struct CorrelatedLinear {
  Eigen::Vector3d prior_mean{1, -0.5, 0.2};
  Eigen::Vector3d prior_sd{1, 2, 0.5};
  Eigen::Matrix3d correlation;
  Eigen::MatrixXd design{4, 3};
  Eigen::Vector4d values{1.4, -1.1, 0.8, 0.3};
  double sd = 0.6;

  CorrelatedLinear() {
    correlation << 1, 0.8, -0.3, 0.8, 1, 0.1, -0.3, 0.1, 1;
    design << 1, 0.2, 0, 0, 1, -0.5, 0.4, 0, 1, 0.3, -0.6, 0.8;
  }
  JointPrior Prior3() const {
    std::vector<Prior> marginals;
    for (int j = 0; j < 3; ++j) {
      marginals.push_back({.kind = PriorKind::kNormal, .mean = prior_mean[j], .sd = prior_sd[j]});
    }
    return JointPrior::Create(marginals, correlation, {}).value();
  }
  DataSet Data() const {
    DataSet data;
    for (int t = 0; t < 4; ++t)
      data.readings.push_back({.load_step = t, .value = values[t], .sd = sd});
    return data;
  }
  Eigen::MatrixXd Predict(const Eigen::MatrixXd& p) const { return p * design.transpose(); }
  Eigen::Matrix3d PriorCovariance() const {
    return prior_sd.asDiagonal() * correlation * prior_sd.asDiagonal();
  }
  Eigen::Matrix3d Covariance() const {
    return (PriorCovariance().inverse() + design.transpose() * design / (sd * sd)).inverse();
  }
  Eigen::Vector3d Mean() const {
    return Covariance() *
           (PriorCovariance().inverse() * prior_mean + design.transpose() * values / (sd * sd));
  }
  double LogEvidence() const {
    Eigen::Matrix4d total = design * PriorCovariance() * design.transpose();
    total.diagonal().array() += sd * sd;
    const Eigen::Vector4d residual = values - design * prior_mean;
    return -0.5 * (residual.dot(total.inverse() * residual) + std::log(total.determinant()) +
                   4 * std::log(2 * std::numbers::pi));
  }
};

TEST(JointPrior, CorrelatedGaussianPosteriorAndEvidenceByTheFilter) {
  const CorrelatedLinear model;
  const FilterOptions options{.design = Design::kSobol, .seed = 3};
  const auto runs = RunIterations(model.Prior3(), model.Data(), options, 3, 1000,
                                  [&](const Eigen::MatrixXd& p) { return model.Predict(p); });
  const auto posterior = ComputePosterior(model.Prior3(), model.Data(), options, runs);
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_EQ(posterior->degeneracy, "");
  EXPECT_NEAR(posterior->log_evidence, model.LogEvidence(), kSigmas * posterior->log_evidence_se);
  EXPECT_LT(posterior->log_evidence_se, 0.1);
  const Eigen::Vector3d sd = model.Covariance().diagonal().cwiseSqrt();
  for (int j = 0; j < 3; ++j) {
    const ParameterSummary& p = posterior->parameters[static_cast<std::size_t>(j)];
    EXPECT_NEAR(p.mean, model.Mean()[j], kSigmas * sd[j] / std::sqrt(posterior->ess));
    EXPECT_NEAR(p.sd / sd[j], 1, kSigmas / std::sqrt(2 * posterior->ess));
  }
}

TEST(JointPrior, CorrelatedGaussianPosteriorAndEvidenceByTmcmc) {
  const CorrelatedLinear model;
  const auto likelihood = GaussianLikelihood::Create(model.Data(), NoiseMode::kGiven);
  const auto state = RunTmcmc(
      model.Prior3(), {.samples = 2000, .seed = 5},
      [&](const Eigen::MatrixXd& rows) { return likelihood->LogLikelihood(model.Predict(rows)); });
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_NEAR(state->log_evidence, model.LogEvidence(),
              kSigmas * state->LogEvidenceStandardError());
  const Eigen::Vector3d sd = model.Covariance().diagonal().cwiseSqrt();
  const double independent = 0.1 * 2000;  // draws that share ancestors count a tenth
  for (int j = 0; j < 3; ++j) {
    EXPECT_NEAR(state->samples.col(j).mean(), model.Mean()[j],
                kSigmas * sd[j] / std::sqrt(independent));
  }
}

// x0 <= x1, both N(0, 1), one reading of x0 - x1: everything of the difference is a truncated
// normal.
struct Ordered {
  double value = 0.4, sd = 0.5;

  JointPrior Prior2() const {
    const std::vector<Prior> marginals(2, Prior{.kind = PriorKind::kNormal, .mean = 0, .sd = 1});
    return JointPrior::Create(marginals, {}, {{.coefficients = Eigen::Vector2d(1, -1), .limit = 0}})
        .value();
  }
  DataSet Data() const {
    DataSet data;
    data.readings.push_back({.value = value, .sd = sd});
    return data;
  }
  static Eigen::MatrixXd Predict(const Eigen::MatrixXd& p) { return p.col(0) - p.col(1); }
  double M() const { return 2 * value / (2 + sd * sd); }
  double Tau() const { return std::sqrt(2 * sd * sd / (2 + sd * sd)); }
  double LogEvidence() const {
    const double total = std::sqrt(2 + sd * sd);
    return std::log(2) + LogNormalDensity(value / total) - std::log(total) +
           LogNormalCdf(-M() / Tau());
  }
  double MeanDifference() const {
    const double a = -M() / Tau();
    return M() - Tau() * std::exp(LogNormalDensity(a) - LogNormalCdf(a));
  }
  double SdDifference() const {
    const double a = -M() / Tau();
    const double ratio = std::exp(LogNormalDensity(a) - LogNormalCdf(a));
    return Tau() * std::sqrt(1 - a * ratio - ratio * ratio);
  }
};

TEST(JointPrior, ConstrainedGaussianByTheFilterInEveryDesign) {
  const Ordered model;
  for (const Design design : {Design::kHalton, Design::kSobol, Design::kLatinHypercube,
                              Design::kSymmetricLatinHypercube}) {
    const FilterOptions options{.design = design, .seed = 7};
    const auto runs =
        RunIterations(model.Prior2(), model.Data(), options, 3, 500, &Ordered::Predict);
    for (const Iteration& iteration : runs) {
      EXPECT_LE((iteration.parameters.col(0) - iteration.parameters.col(1)).maxCoeff(), 0);
    }
    const auto posterior = ComputePosterior(model.Prior2(), model.Data(), options, runs);
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    EXPECT_NEAR(posterior->log_evidence, model.LogEvidence(), kSigmas * posterior->log_evidence_se);
    const double mean = posterior->parameters[0].mean - posterior->parameters[1].mean;
    EXPECT_NEAR(mean, model.MeanDifference(),
                kSigmas * model.SdDifference() / std::sqrt(posterior->ess));
  }
}

TEST(JointPrior, ConstrainedGaussianByTmcmc) {
  const Ordered model;
  const auto likelihood = GaussianLikelihood::Create(model.Data(), NoiseMode::kGiven);
  const auto state =
      RunTmcmc(model.Prior2(), {.samples = 2000, .seed = 2}, [&](const Eigen::MatrixXd& rows) {
        return likelihood->LogLikelihood(Ordered::Predict(rows));
      });
  ASSERT_TRUE(state.ok()) << state.status();
  const Eigen::VectorXd difference = state->samples.col(0) - state->samples.col(1);
  EXPECT_LE(difference.maxCoeff(), 0);
  EXPECT_NEAR(state->log_evidence, model.LogEvidence(),
              kSigmas * state->LogEvidenceStandardError());
  EXPECT_NEAR(difference.mean(), model.MeanDifference(),
              kSigmas * model.SdDifference() / std::sqrt(200.0));
}

// A linear response is emulated all but exactly, so that the emulator's own error adds nothing.
TEST(JointPrior, ConstrainedGaussianOnTheEmulator) {
  const Ordered model;
  const FilterOptions options{.seed = 7};
  const auto runs = RunIterations(model.Prior2(), model.Data(), options, 1, 60, &Ordered::Predict);
  const auto result = EmulatedPosterior(model.Prior2(), model.Data(), {.seed = 4}, runs);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_TRUE(result->adequate) << result->reason;
  const Eigen::VectorXd difference = result->draws.col(0) - result->draws.col(1);
  EXPECT_LE(difference.maxCoeff(), 0);
  EXPECT_NEAR(result->log_evidence, model.LogEvidence(), kSigmas * result->log_evidence_se);
  EXPECT_NEAR(difference.mean(), model.MeanDifference(),
              kSigmas * model.SdDifference() / std::sqrt(200.0));
}

TEST(JointPrior, DensityIntegratesToOne) {
  const std::vector<Prior> marginals = {
      {.kind = PriorKind::kUniform, .min = -1, .max = 3},
      {.kind = PriorKind::kNormal, .min = -2, .max = 1.5, .mean = 0, .sd = 1}};
  Eigen::Matrix2d correlation;
  correlation << 1, 0.6, 0.6, 1;
  const auto prior = JointPrior::Create(marginals, correlation,
                                        {{.coefficients = Eigen::Vector2d(1, 1), .limit = 2}});
  ASSERT_TRUE(prior.ok()) << prior.status();
  constexpr int kCells = 800;
  double sum = 0;
  double first = 0;
  for (int i = 0; i < kCells; ++i) {
    for (int k = 0; k < kCells; ++k) {
      const Eigen::Vector2d x(-1 + 4 * (i + 0.5) / kCells, -2 + 3.5 * (k + 0.5) / kCells);
      const double mass = std::exp(prior->LogDensity(x)) * 14 / (kCells * kCells);
      sum += mass;
      first += mass * x[0];
    }
  }
  // Along the cut one cell in kCells is half wrong.
  EXPECT_NEAR(sum, 1, kSigmas * prior->mass_error() + 2.0 / kCells);
  double drawn = 0;
  constexpr int kDraws = 4000;
  for (int i = 0; i < kDraws; ++i) {
    PhiloxStream stream({.seed = 1, .sample = static_cast<std::uint64_t>(i)});
    drawn += prior->Draw(stream)[0] / kDraws;
  }
  EXPECT_NEAR(drawn, first / sum,
              kSigmas * 1.2 / std::sqrt(kDraws));  // its sd is below 4 / sqrt 12
}

TEST(JointPrior, MassOfATriangleIsOneHalf) {
  const std::vector<Prior> marginals(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  const auto prior =
      JointPrior::Create(marginals, {}, {{.coefficients = Eigen::Vector2d(1, 1), .limit = 1}});
  ASSERT_TRUE(prior.ok());
  EXPECT_NEAR(std::exp(prior->log_mass()), 0.5, 0.5 * kSigmas * prior->mass_error());
  EXPECT_LE(prior->mass_error(), 1e-3);
}

}  // namespace
}  // namespace calib::inference
