// TMCMC against problems of exactly known evidence [reference/inference/README.md, sec. 3], with
// the tolerances stated there: |log Z - exact| <= 0.3 for each seed, mean over five seeds <= 0.15,
// posterior means within 0.15 sd, sd within 10 %. Two modes are held to four standard errors over
// twenty seeds, whose errors had a root mean square of 0.023 in the mode's mass and of 0.039 nats
// in the evidence.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <iostream>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "inference/tmcmc/tmcmc.h"
#include "tests/data/inference/reference_files.h"

namespace calib::inference {
namespace {

constexpr int kSeeds = 5;

nlohmann::json Case(const std::string& name) {
  const nlohmann::json all = ReadReference("evidence_analytic.json");
  for (const auto& one : all.at("cases")) {
    if (one.at("case") == name) return one;
  }
  ADD_FAILURE() << "no case " << name;
  return {};
}

std::vector<Prior> Box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  std::vector<Prior> priors;
  for (Eigen::Index j = 0; j < lower.size(); ++j) {
    priors.push_back({.kind = PriorKind::kUniform, .min = lower[j], .max = upper[j]});
  }
  return priors;
}

double LogGaussian(const Eigen::VectorXd& residual, const Eigen::VectorXd& variance) {
  double sum = 0;
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    sum -= 0.5 *
           (std::log(2 * std::numbers::pi * variance[i]) + residual[i] * residual[i] / variance[i]);
  }
  return sum;
}

BatchLogLikelihood ByRow(std::function<double(const Eigen::VectorXd&)> one) {
  return [one = std::move(one)](const Eigen::MatrixXd& rows) {
    Eigen::VectorXd result(rows.rows());
    for (Eigen::Index i = 0; i < rows.rows(); ++i) result[i] = one(rows.row(i));
    return result;
  };
}

struct Exact {
  double log_evidence = 0;
  Eigen::VectorXd mean;
  Eigen::VectorXd sd;
};

void Compare(const std::string& name, const std::vector<Prior>& priors,
             const BatchLogLikelihood& log_likelihood, const Exact& exact) {
  double mean_error = 0;
  double squares = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const auto state = RunTmcmc(priors, {.samples = 2000, .seed = seed}, log_likelihood);
    ASSERT_TRUE(state.ok()) << state.status();
    const double error = state->log_evidence - exact.log_evidence;
    EXPECT_LE(std::abs(error), 0.3) << name << " seed " << seed;
    mean_error += error / kSeeds;
    const double normalised = error / state->LogEvidenceStandardError();
    squares += normalised * normalised;
    for (Eigen::Index j = 0; j < exact.mean.size(); ++j) {
      const double mean = state->samples.col(j).mean();
      const double sd = std::sqrt((state->samples.col(j).array() - mean).square().mean());
      EXPECT_LE(std::abs(mean - exact.mean[j]), 0.15 * exact.sd[j])
          << name << " parameter " << j << " seed " << seed;
      EXPECT_NEAR(sd / exact.sd[j], 1, 0.1) << name << " parameter " << j << " seed " << seed;
    }
  }
  EXPECT_LE(std::abs(mean_error), 0.15) << name;
  std::cout << name << ": mean error " << mean_error << ", rms error over stated "
            << std::sqrt(squares / kSeeds) << '\n';
  // The standard errors are right in size: five chi-squares of mean one exceed 20.5 with
  // probability 0.001.
  EXPECT_LE(squares, 20.5) << name;
}

void CompareLinearGaussian(const std::string& name) {
  const auto problem = Case(name);
  const Eigen::MatrixXd a = ToMatrix(problem.at("A"));
  const Eigen::VectorXd y = ToVector(problem.at("y"));
  const Eigen::VectorXd variance = ToVector(problem.at("noise_variance"));
  const Eigen::VectorXd mean = ToVector(problem.at("prior_mean"));
  const Eigen::VectorXd prior_variance = ToVector(problem.at("prior_variance"));
  std::vector<Prior> priors;
  for (Eigen::Index j = 0; j < mean.size(); ++j) {
    priors.push_back(
        {.kind = PriorKind::kNormal, .mean = mean[j], .sd = std::sqrt(prior_variance[j])});
  }
  Compare(name, priors,
          ByRow([&](const Eigen::VectorXd& theta) { return LogGaussian(y - a * theta, variance); }),
          {.log_evidence = problem.at("log_evidence"),
           .mean = ToVector(problem.at("posterior_mean")),
           .sd = ToMatrix(problem.at("posterior_cov")).diagonal().cwiseSqrt()});
}

TEST(TmcmcReference, LinearGaussian2d) { CompareLinearGaussian("linear_gaussian_2d"); }
TEST(TmcmcReference, LinearGaussian5d) { CompareLinearGaussian("linear_gaussian_5d"); }

TEST(TmcmcReference, UniformBox3d) {
  const auto problem = Case("uniform_box_3d");
  const Eigen::MatrixXd a = ToMatrix(problem.at("A"));
  const Eigen::VectorXd y = ToVector(problem.at("y"));
  const double s = problem.at("s");
  const Eigen::VectorXd variance = Eigen::VectorXd::Constant(y.size(), s * s);
  Compare("uniform_box_3d", Box(ToVector(problem.at("lower")), ToVector(problem.at("upper"))),
          ByRow([&](const Eigen::VectorXd& theta) { return LogGaussian(y - a * theta, variance); }),
          {.log_evidence = problem.at("log_evidence"),
           .mean = ToVector(problem.at("posterior_mean")),
           .sd = ToMatrix(problem.at("posterior_cov")).diagonal().cwiseSqrt()});
}

TEST(TmcmcReference, UnknownNoiseVariance) {
  const auto problem = Case("uniform_box_2d_plus_noise_variance");
  const Eigen::MatrixXd a = ToMatrix(problem.at("A"));
  const Eigen::VectorXd y = ToVector(problem.at("y"));
  Eigen::VectorXd lower(3);
  Eigen::VectorXd upper(3);
  lower << ToVector(problem.at("lower")), 0.0;
  upper << ToVector(problem.at("upper")), problem.at("v_max").get<double>();
  Exact exact{.log_evidence = problem.at("log_evidence"),
              .mean = Eigen::VectorXd(3),
              .sd = Eigen::VectorXd(3)};
  exact.mean << ToVector(problem.at("posterior_mean_theta")),
      problem.at("posterior_mean_v").get<double>();
  exact.sd << ToMatrix(problem.at("posterior_cov_theta")).diagonal().cwiseSqrt(),
      problem.at("posterior_sd_v").get<double>();
  Compare("uniform_box_2d_plus_noise_variance", Box(lower, upper),
          ByRow([&](const Eigen::VectorXd& theta) {
            return LogGaussian(y - a * theta.head(2),
                               Eigen::VectorXd::Constant(y.size(), theta[2]));
          }),
          exact);
}

TEST(TmcmcReference, TwoModes) {
  const auto problem = Case("bimodal_2d");
  const Eigen::VectorXd w = ToVector(problem.at("w"));
  const Eigen::MatrixXd m = ToMatrix(problem.at("m"));
  const Eigen::MatrixXd sd = ToMatrix(problem.at("sd"));
  const double c0 = problem.at("c0");
  const auto log_likelihood = ByRow([&](const Eigen::VectorXd& theta) {
    double sum = 0;
    for (Eigen::Index k = 0; k < w.size(); ++k) {
      sum += w[k] * std::exp(LogGaussian(theta - m.row(k).transpose(), sd.row(k).array().square()));
    }
    return c0 + std::log(sum);
  });
  const auto priors = Box(ToVector(problem.at("lower")), ToVector(problem.at("upper")));
  double mean_error = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const auto state = RunTmcmc(priors, {.samples = 2000, .seed = seed}, log_likelihood);
    ASSERT_TRUE(state.ok()) << state.status();
    const double error = state->log_evidence - problem.at("log_evidence").get<double>();
    EXPECT_LE(std::abs(error), 4 * 0.039) << "seed " << seed;
    mean_error += error / kSeeds;
    const double first = (state->samples.col(0).array() < 0).cast<double>().mean();
    EXPECT_NEAR(first, problem.at("posterior_mode_masses")[0].get<double>(), 4 * 0.023)
        << "seed " << seed;
  }
  EXPECT_LE(std::abs(mean_error), 4 * 0.039 / std::sqrt(kSeeds));
  std::cout << "bimodal_2d: mean error " << mean_error << '\n';
}

}  // namespace
}  // namespace calib::inference
