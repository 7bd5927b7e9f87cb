// The pass over samples against the same sums written out.

#include "inference/mixture/softmax_moments.h"

#include <gtest/gtest.h>

#include <cmath>

#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

struct Sums {
  Eigen::MatrixXd moments;
  double entropy = 0;
};

Sums WrittenOut(const Eigen::MatrixXd& features, const Eigen::VectorXd& counts,
                const Eigen::MatrixXd& coefficients) {
  Sums sums{.moments = Eigen::MatrixXd::Zero(features.cols(), coefficients.cols())};
  for (Eigen::Index i = 0; i < features.rows(); ++i) {
    const Eigen::VectorXd log_rho = (features.row(i) * coefficients).transpose();
    const double largest = log_rho.maxCoeff();
    const double log_sum = largest + std::log((log_rho.array() - largest).exp().sum());
    for (Eigen::Index k = 0; k < coefficients.cols(); ++k) {
      const double r = std::exp(log_rho[k] - log_sum);
      sums.moments.col(k) += counts[i] * r * features.row(i).transpose();
      sums.entropy -= counts[i] * r * (log_rho[k] - log_sum);
    }
  }
  return sums;
}

Eigen::MatrixXd Normals(Eigen::Index rows, Eigen::Index cols, std::uint64_t seed) {
  PhiloxStream stream({.seed = seed});
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return stream.Normal(); });
}

// Numbers of samples and components that fill the lanes and that do not.
TEST(SoftmaxMoments, AreTheSumsWrittenOut) {
  for (const int n : {1, 7, 8, 37}) {
    for (const int components : {1, 4, 6}) {
      const Eigen::MatrixXd features = Normals(n, 5, 1);
      const Eigen::VectorXd counts = Normals(n, 1, 2).cwiseAbs();
      SoftmaxMoments samples(features, counts, components);
      for (const double steepness : {0.1, 3.0, 40.0}) {
        const Eigen::MatrixXd coefficients = steepness * Normals(5, components, 3);
        samples.Pass(coefficients);
        const Sums expected = WrittenOut(features, counts, coefficients);
        EXPECT_LE((samples.moments() - expected.moments).cwiseAbs().maxCoeff(), 1e-13 * n);
        EXPECT_NEAR(samples.entropy(), expected.entropy, 1e-13 * n * (1 + steepness));
      }
    }
  }
}

// A component that is out of reach by more than a double can tell takes nothing and breaks nothing.
TEST(SoftmaxMoments, ComponentFarAwayTakesNothing) {
  const Eigen::MatrixXd features = Eigen::MatrixXd::Ones(9, 1);
  SoftmaxMoments samples(features, Eigen::VectorXd::Ones(9), 2);
  samples.Pass(Eigen::RowVector2d(3, -1e5));
  EXPECT_DOUBLE_EQ(samples.moments()(0, 0), 9);
  EXPECT_LE(samples.moments()(0, 1), 1e-300);
  EXPECT_NEAR(samples.entropy(), 0, 1e-290);
}

TEST(SoftmaxMoments, ExponentialIsThatOfTheLibrary) {
  for (double x = -699; x <= 0; x += 0.37) {
    Lanes lanes = Lanes{} + x;
    Exponential(lanes);
    for (int lane = 0; lane < kLanes; ++lane) EXPECT_NEAR(lanes[lane] / std::exp(x), 1, 5e-16) << x;
  }
}

}  // namespace
}  // namespace calib::inference
