// TMCMC where the answer is known in closed form.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "inference/data/gaussian_likelihood.h"
#include "inference/tmcmc/tmcmc.h"
#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

constexpr double kSigmas = 4;  // once in 16 000 times

// Draws that descend from one prior draw are related: as if there were as many independent ones as
// there are families, 1 / sum of squared shares. Moves within a mode make more of them; the limits
// are on the safe side by that.
double Families(const TmcmcState& state) {
  std::map<int, double> share;
  for (const int ancestor : state.ancestor)
    share[ancestor] += 1.0 / static_cast<double>(state.ancestor.size());
  double squares = 0;
  for (const auto& [ancestor, part] : share) squares += part * part;
  return 1 / squares;
}

// Evidence and its standard error over seeds: the errors must be as large as stated.
TEST(TmcmcEvidence, LinearGaussianInTwoFiveAndTenDimensions) {
  for (const int d : {2, 5, 10}) {
    const LinearModel model(3 * d, d, 0.5, 21);
    const auto likelihood = GaussianLikelihood::Create(model.Data(), NoiseMode::kGiven);
    ASSERT_TRUE(likelihood.ok());
    double squares = 0;
    constexpr int kSeeds = 5;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const auto state = RunTmcmc(model.priors, {.samples = 1000, .steps = 15, .seed = seed},
                                  [&](const Eigen::MatrixXd& rows) {
                                    return likelihood->LogLikelihood(model.Predict(rows));
                                  });
      ASSERT_TRUE(state.ok());
      const double error = state->log_evidence - model.LogEvidence();
      EXPECT_NEAR(error, 0, kSigmas * state->LogEvidenceStandardError())
          << "d = " << d << ", seed " << seed;
      const double normalised = error / state->LogEvidenceStandardError();
      squares += normalised * normalised;
      const Eigen::VectorXd exact = model.PosteriorMean();
      const Eigen::MatrixXd covariance = model.PosteriorCovariance();
      for (int j = 0; j < d; ++j) {
        EXPECT_NEAR(state->samples.col(j).mean(), exact[j],
                    kSigmas * std::sqrt(covariance(j, j) / Families(*state)))
            << "d = " << d;
      }
    }
    EXPECT_LE(squares, 20.5) << "d = " << d;  // chi-square of five, probability 0.001
  }
}

// The same from densities that are not the prior: narrow and two of its sd from its mean, and ten
// times as wide as the posterior about a point three of its sd from its mean.
TEST(TmcmcEvidence, LinearGaussianFromAFirstProposal) {
  for (const int d : {2, 5}) {
    const LinearModel model(3 * d, d, 0.5, 21);
    const JointPrior priors(model.priors);
    const auto likelihood = GaussianLikelihood::Create(model.Data(), NoiseMode::kGiven);
    ASSERT_TRUE(likelihood.ok());
    const Eigen::VectorXd exact = model.PosteriorMean();
    const Eigen::VectorXd sd = model.PosteriorCovariance().diagonal().array().sqrt();
    for (const bool far : {true, false}) {
      MixtureComponent component{.weight = 1,
                                 .mean = Eigen::VectorXd::Constant(d, -2),
                                 .covariance = 0.04 * Eigen::MatrixXd::Identity(d, d)};
      for (int j = 0; j < d && !far; ++j) {
        const double wide = sd[j] / model.priors[static_cast<std::size_t>(j)].sd;
        component.mean[j] = priors[static_cast<std::size_t>(j)].ToStandard(exact[j]) + 3 * wide;
        component.covariance(j, j) = 100 * wide * wide;
      }
      Proposal first;
      first.components = {component};
      first.defensive_share = far ? 0.1 : 0.5;
      double squares = 0;
      for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        const auto state =
            RunTmcmc(priors, {.samples = 1000, .steps = 15, .seed = seed, .first = first},
                     [&](const Eigen::MatrixXd& rows) {
                       return likelihood->LogLikelihood(model.Predict(rows));
                     });
        ASSERT_TRUE(state.ok()) << state.status();
        const double error = state->log_evidence - model.LogEvidence();
        EXPECT_NEAR(error, 0, kSigmas * state->LogEvidenceStandardError())
            << "d = " << d << ", seed " << seed << (far ? ", far" : ", near");
        squares += std::pow(error / state->LogEvidenceStandardError(), 2);
        for (int j = 0; j < d; ++j) {
          const Eigen::ArrayXd x = state->samples.col(j);
          const double few = kSigmas * sd[j] / std::sqrt(Families(*state));
          EXPECT_NEAR(x.mean(), exact[j], few) << "d = " << d;
          EXPECT_NEAR(std::sqrt((x - x.mean()).square().mean()), sd[j], few / std::sqrt(2.0));
        }
      }
      // Chi-square of three, probability 0.001.
      EXPECT_LE(squares, 16.3) << "d = " << d << (far ? ", far" : ", near");
    }
  }
}

// Two modes far apart in a wide box, one narrow: both are kept with their masses.
TEST(TmcmcEvidence, KeepsBothModes) {
  const std::vector<Prior> box(2, Prior{.kind = PriorKind::kUniform, .min = -10, .max = 10});
  const auto log_density = [](double x, double y) {
    const auto mode = [](double dx, double dy, double sd) {
      return std::exp(-0.5 * (dx * dx + dy * dy) / (sd * sd)) / (2 * std::numbers::pi * sd * sd);
    };
    return std::log(0.6 * mode(x + 4, y + 3, 0.6) + 0.4 * mode(x - 5, y - 2, 0.2));
  };
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const auto state =
        RunTmcmc(box, {.samples = 2000, .seed = seed}, [&](const Eigen::MatrixXd& rows) {
          Eigen::VectorXd result(rows.rows());
          for (Eigen::Index i = 0; i < rows.rows(); ++i)
            result[i] = log_density(rows(i, 0), rows(i, 1));
          return result;
        });
    ASSERT_TRUE(state.ok());
    EXPECT_NEAR(state->log_evidence, -std::log(400.0), kSigmas * state->LogEvidenceStandardError());
    // No chain crosses the gap, so a family stays in its mode.
    EXPECT_NEAR((state->samples.col(0).array() < 0).cast<double>().mean(), 0.6,
                kSigmas * std::sqrt(0.6 * 0.4 / Families(*state)));
  }
}

// A posterior that leans on a corner of its box: exp(-k (x + y)) on the unit square.
TEST(TmcmcEvidence, BoxPriorCutsThePosterior) {
  const std::vector<Prior> box(2, Prior{.kind = PriorKind::kUniform, .min = 0, .max = 1});
  const double k = 40;
  const auto state = RunTmcmc(box, {.samples = 2000, .seed = 8}, [&](const Eigen::MatrixXd& rows) {
    return Eigen::VectorXd(-k * rows.rowwise().sum());
  });
  ASSERT_TRUE(state.ok());
  const double one = (1 - std::exp(-k)) / k;
  EXPECT_NEAR(state->log_evidence, 2 * std::log(one), kSigmas * state->LogEvidenceStandardError());
  EXPECT_NEAR(state->samples.col(0).mean(), 1 / k, kSigmas / k / std::sqrt(Families(*state)));
}

}  // namespace
}  // namespace calib::inference
