#include "inference/filter/widened_posterior.h"

#include <gtest/gtest.h>

#include <cmath>

#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr Index kReadings = 20;
constexpr int kSamples = 20000;
constexpr double kNoise = 0.4;

// A slope and an offset.
Eigen::MatrixXd Sensitivity() {
  Eigen::MatrixXd j(kReadings, 2);
  for (Index k = 0; k < kReadings; ++k) j.row(k) << static_cast<double>(k) / kReadings, 1;
  return j;
}

class WidenedPosterior : public testing::Test {
 protected:
  WidenedPosterior() {
    const Eigen::MatrixXd j = Sensitivity();
    for (Index k = 0; k < kReadings; ++k) {
      data_.readings.push_back({.experiment = 0,
                                .observable = 0,
                                .load_step = static_cast<int>(k),
                                .value = j.row(k).sum(),
                                .sd = kNoise});
    }
    const auto n = DrawSamples(Proposal{}, priors_, options_, 0, kSamples);
    EXPECT_TRUE(n.ok());
    iterations_.resize(1);
    iterations_[0].parameters = *n;
    iterations_[0].predictions = *n * j.transpose();
    const auto found = ComputePosterior(priors_, data_, options_, iterations_);
    EXPECT_TRUE(found.ok()) << found.status();
    before_ = *found;
    EXPECT_EQ(before_.degeneracy, "");
  }

  // Packings that lift the whole curve by these.
  static Replicates Lifting(const Eigen::VectorXd& by) {
    const Eigen::VectorXd centred = by.array() - by.mean();
    return {.departures = centred * Eigen::RowVectorXd::Ones(kReadings),
            .scatter = Eigen::MatrixXd::Zero(kReadings, kReadings)};
  }

  JointPrior priors_ = std::vector<Prior>(2, {.kind = PriorKind::kUniform, .min = -2, .max = 4});
  FilterOptions options_{.noise = NoiseMode::kGiven};
  DataSet data_;
  std::vector<Iteration> iterations_;
  Posterior before_;
};

TEST_F(WidenedPosterior, TakesInWhatRefitsOfThePackingsDifferBy) {
  // An offset that packings shift by 0.5 (rms) while the noise leaves it unsure by a third of that.
  const Replicates packings = Lifting(Eigen::VectorXd::LinSpaced(8, -0.75, 0.75));
  Posterior after = before_;
  const double widened = WidenByRefits(priors_, data_, packings, iterations_, 3, after);
  const double added =
      std::sqrt(std::pow(after.parameters[1].sd, 2) - std::pow(before_.parameters[1].sd, 2));
  EXPECT_NEAR(added, 0.5 * 1.15, 0.1);  // 1.15: Student's with seven degrees over the normal one
  EXPECT_GT(widened, 1.5);
  EXPECT_EQ(after.parameters[1].mean, before_.parameters[1].mean);
  EXPECT_NEAR(after.parameters[1].q95 - after.parameters[1].q05, 3.29 * after.parameters[1].sd,
              0.1 * after.parameters[1].sd);
  // The slope is no lift.
  EXPECT_NEAR(after.parameters[0].sd, before_.parameters[0].sd, 0.1 * before_.parameters[0].sd);
  // What is added to the offset alone leaves its covariance with the slope.
  EXPECT_NEAR(after.correlation(0, 1),
              before_.correlation(0, 1) * before_.parameters[1].sd / after.parameters[1].sd, 0.12);
  EXPECT_GT(std::abs(before_.correlation(0, 1)), 0.5);
  Posterior again = before_;
  EXPECT_EQ(WidenByRefits(priors_, data_, packings, iterations_, 3, again), widened);
}

TEST_F(WidenedPosterior, NothingChangesWherePackingsDoNotDiffer) {
  Posterior after = before_;
  EXPECT_EQ(WidenByRefits(priors_, data_, Lifting(Eigen::VectorXd::Zero(8)), iterations_, 3, after),
            1);
  EXPECT_EQ(after.parameters[1].sd, before_.parameters[1].sd);
}

}  // namespace
}  // namespace calib::inference
