// The log evidence of emulated posteriors is off by about as much as it says.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <iostream>
#include <numbers>

#include "inference/emulator/emulated_posterior.h"
#include "inference/emulator/split_half.h"
#include "inference/sampling/sobol.h"
#include "inference/tmcmc/tmcmc.h"
#include "tests/verification/inference/toy_curve.h"

namespace calib::inference {
namespace {

// Of ToyCurve::Run relative to its mean curve, in units of `scatter` [PathScatter].
Eigen::MatrixXd CovarianceOfScatter(const ToyCurve& toy) {
  const auto share = [half = toy.readings / 2](int t) {
    return static_cast<double>(t % half) / half;
  };
  Eigen::MatrixXd covariance(toy.readings, toy.readings);
  for (int a = 0; a < toy.readings; ++a) {
    for (int b = 0; b <= a; ++b) {
      const double walk = std::pow(0.9, a - b) * (1 - std::pow(0.81, b + 1));
      covariance(a, b) = covariance(b, a) = 0.36 * (1 + share(a) * share(b)) + 0.25 * walk;
    }
  }
  return covariance;
}

// The true response and the true scatter.
double ExactLogEvidence(const ToyCurve& toy, const DataSet& data, std::uint64_t seed) {
  const Eigen::MatrixXd scatter = CovarianceOfScatter(toy);
  const auto log_likelihood = [&](const Eigen::MatrixXd& points) {
    Eigen::VectorXd values(points.rows());
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      const Eigen::VectorXd mean = toy.Mean(points.row(i));
      Eigen::MatrixXd covariance = toy.scatter * toy.scatter * mean.asDiagonal() * scatter;
      covariance = covariance * mean.asDiagonal();
      Eigen::VectorXd residual(toy.readings);
      for (int t = 0; t < toy.readings; ++t) {
        const Reading& reading = data.readings[static_cast<std::size_t>(t)];
        covariance(t, t) += reading.sd * reading.sd;
        residual[t] = reading.value - mean[t];
      }
      const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
      const Eigen::VectorXd z = factor.matrixL().solve(residual);
      values[i] = -0.5 * z.squaredNorm() - factor.matrixLLT().diagonal().array().log().sum() -
                  0.5 * toy.readings * std::log(2 * std::numbers::pi);
    }
    return values;
  };
  const auto state = RunTmcmc(toy.Priors(), {.samples = 1000, .seed = seed}, log_likelihood);
  EXPECT_TRUE(state.ok()) << state.status();
  return state.ok() ? state->log_evidence : 0;
}

TEST(EmulatorEvidenceSlow, IsOffByAboutAsMuchAsItSays) {
  for (const double scatter : {0.0, 0.005}) {
    const ToyCurve toy{.d = 3, .scatter = scatter};
    constexpr int kCampaigns = 8;
    constexpr int kRuns = 60;
    double off = 0;       // squares
    double relative = 0;  // of what is off over what is stated
    double sampling = 0;
    for (std::uint64_t r = 0; r < kCampaigns; ++r) {
      PhiloxStream stream(
          {.seed = 700 + r, .purpose = StreamPurpose::kTest, .iteration = 3, .sample = 0});
      const Eigen::Vector3d truth(stream.Uniform(), stream.Uniform(), stream.Uniform());
      const DataSet data = toy.Measure(truth, 0.01, 700 + r);
      Iteration runs;
      runs.parameters = ScrambledSobol(kRuns, 3, r);
      runs.predictions.resize(kRuns, toy.readings);
      for (int i = 0; i < kRuns; ++i) {
        runs.predictions.row(i) = toy.Run(runs.parameters.row(i), r, static_cast<std::uint64_t>(i));
      }
      const EmulatorOptions options{.draws = 1000, .seed = r};
      const auto emulated = EmulatedPosterior(toy.Priors(), data, options, {&runs, 1});
      ASSERT_TRUE(emulated.ok()) << emulated.status();
      const SplitHalf split =
          SplitHalfOfEmulator(toy.Priors(), data, options, {&runs, 1}, *emulated);
      const double error = emulated->log_evidence - ExactLogEvidence(toy, data, r);
      off += error * error;
      relative +=
          std::pow(error / std::hypot(emulated->log_evidence_se, split.log_evidence_error), 2);
      sampling += std::pow(error / emulated->log_evidence_se, 2);
    }
    const auto rms = [](double sum) { return std::sqrt(sum / kCampaigns); };
    std::cout << "scatter " << scatter << ": log evidence off by " << rms(off) << ", "
              << rms(relative) << " of what is stated, " << rms(sampling)
              << " of the sampling's part\n";
    EXPECT_LT(rms(relative), 2.5);
    EXPECT_GT(rms(relative), 0.3);
  }
}

}  // namespace
}  // namespace calib::inference
