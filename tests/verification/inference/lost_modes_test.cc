// Modes that iterations have seen and left: neither the spread of weights nor their tail tells.
#include "inference/evidence/lost_modes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "tests/verification/inference/linear_model.h"

namespace calib::inference {
namespace {

using ::testing::HasSubstr;

constexpr int kDimensions = 4;
constexpr double kSpan = 4;     // the prior is uniform between -4 and 4
constexpr double kError = 0.3;  // sd of a mode
constexpr int kSamples = 400;   // of an iteration

// Three equal modes; a reading for each parameter is its distance from the nearest mode.
class ThreeModes {
 public:
  ThreeModes() : centres_(3, kDimensions), priors_(std::vector<Prior>(kDimensions, kFlat)) {
    centres_ << 2, 2, 2, 2, -2, -2, 2, -2, -2, 2, -2, 1;
    for (int j = 0; j < kDimensions; ++j) {
      data_.readings.push_back({.load_step = j, .value = 0, .sd = kError});
    }
  }

  [[nodiscard]] Eigen::MatrixXd Predict(const Eigen::MatrixXd& parameters) const {
    Eigen::MatrixXd readings = parameters;
    for (Eigen::Index i = 0; i < parameters.rows(); ++i) {
      Eigen::Index nearest = 0;
      (centres_.rowwise() - parameters.row(i)).rowwise().squaredNorm().minCoeff(&nearest);
      readings.row(i) -= centres_.row(nearest);
    }
    return readings;
  }

  // An iteration from equal components of one sd about some of the modes.
  [[nodiscard]] Iteration Around(const std::vector<int>& modes, double sd, int number) const {
    Iteration iteration;
    if (!modes.empty()) {
      const double scale = priors_[0].ToStandard(1) - priors_[0].ToStandard(0);
      for (const int mode : modes) {
        iteration.proposal.components.push_back(
            {.weight = 1.0 / static_cast<double>(modes.size()),
             .mean = priors_.ToStandard(centres_.row(mode)),
             .covariance =
                 std::pow(sd * scale, 2) * Eigen::MatrixXd::Identity(kDimensions, kDimensions)});
      }
      iteration.proposal.defensive_share = 0.1;
      iteration.proposal.log_acceptance = LogMassInSupport(iteration.proposal.components, priors_);
    }
    iteration.parameters =
        DrawSamples(iteration.proposal, priors_, {.seed = 5}, number, kSamples).value();
    iteration.predictions = Predict(iteration.parameters);
    return iteration;
  }

  [[nodiscard]] double LogEvidence() const {
    return std::log(3) - kDimensions * std::log(2 * kSpan);
  }
  [[nodiscard]] const JointPrior& priors() const { return priors_; }
  [[nodiscard]] const DataSet& data() const { return data_; }

 private:
  static constexpr Prior kFlat = {.kind = PriorKind::kUniform, .min = -kSpan, .max = kSpan};
  Eigen::MatrixXd centres_;
  JointPrior priors_;
  DataSet data_;
};

// The last iterations have two of three modes: ln Z is off by ln 3/2 = 0.405.
TEST(LostModes, AModeThatIterationsHaveLeftIsSaid) {
  const ThreeModes model;
  const std::vector<Iteration> iterations = {
      model.Around({}, 0, 0), model.Around({0, 1, 2}, 1.5, 1), model.Around({0, 1}, 0.6, 2),
      model.Around({0, 1}, 0.35, 3)};
  const Posterior posterior =
      ComputePosterior(model.priors(), model.data(), {}, iterations).value();
  const double off = model.LogEvidence() - posterior.log_evidence;
  EXPECT_NEAR(off, std::log(1.5), 0.1) << "the case is no longer one";
  EXPECT_LT(posterior.pareto_k, 0.7);
  EXPECT_GT(posterior.ess, 50);
  EXPECT_THAT(posterior.degeneracy, HasSubstr("A mode may be lost"));
  EXPECT_GT(posterior.log_evidence_se, off / 2);
}

TEST(LostModes, WhereAllModesAreSampledNothingIsSaid) {
  const ThreeModes model;
  const std::vector<Iteration> iterations = {
      model.Around({}, 0, 0), model.Around({0, 1, 2}, 1.5, 1), model.Around({0, 1, 2}, 0.6, 2),
      model.Around({0, 1, 2}, 0.35, 3)};
  const Posterior posterior =
      ComputePosterior(model.priors(), model.data(), {}, iterations).value();
  EXPECT_EQ(posterior.degeneracy, "");
  EXPECT_NEAR(posterior.log_evidence, model.LogEvidence(), 4 * posterior.log_evidence_se);
  EXPECT_LT(posterior.log_evidence_se, 0.1);
}

}  // namespace
}  // namespace calib::inference
