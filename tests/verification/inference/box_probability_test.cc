#include "inference/mixture/box_probability.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "inference/mixture/gaussian_mixture.h"

namespace calib::inference {
namespace {

TEST(BoxProbability, DiagonalIsTheProductOfIntervals) {
  const Eigen::MatrixXd cholesky = Eigen::Vector2d(2, 0.5).asDiagonal();
  const double expected =
      0.5 * (std::erf(1 / std::numbers::sqrt2)) * std::erfc(1 / std::numbers::sqrt2);
  EXPECT_NEAR(BoxProbability(cholesky, Eigen::Vector2d(-2, 0.5), Eigen::Vector2d(2, INFINITY)),
              expected, 1e-14);
}

// Orthants have closed forms: 1/4 + asin(r) / 2 pi in two, 1/8 + (sum of asin) / 4 pi in three
// dimensions.
TEST(BoxProbability, OrthantsInTwoAndThreeDimensions) {
  for (const double r : {-0.9, -0.3, 0.5, 0.95}) {
    Eigen::Matrix2d covariance;
    covariance << 1, r, r, 1;
    const Eigen::MatrixXd cholesky = covariance.llt().matrixL();
    EXPECT_NEAR(
        BoxProbability(cholesky, Eigen::Vector2d::Zero(), Eigen::Vector2d::Constant(INFINITY)),
        0.25 + std::asin(r) / (2 * std::numbers::pi), 1e-4);
  }
  Eigen::Matrix3d covariance;
  covariance << 1, 0.6, 0.3, 0.6, 1, -0.2, 0.3, -0.2, 1;
  const Eigen::MatrixXd cholesky = covariance.llt().matrixL();
  EXPECT_NEAR(
      BoxProbability(cholesky, Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(INFINITY)),
      0.125 + (std::asin(0.6) + std::asin(0.3) + std::asin(-0.2)) / (4 * std::numbers::pi), 2e-4);
}

// Equicorrelated orthant, r = 1/2: 1 / (d + 1). The points are fixed and so is the error,
// of 1.7e-3; limits in two and three dimensions are two to three times the errors found there.
TEST(BoxProbability, OrthantInSixDimensions) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Constant(6, 6, 0.5);
  covariance.diagonal().setOnes();
  const Eigen::MatrixXd cholesky = covariance.llt().matrixL();
  EXPECT_NEAR(
      BoxProbability(cholesky, Eigen::VectorXd::Zero(6), Eigen::VectorXd::Constant(6, INFINITY)),
      1.0 / 7, 2e-3 / 7);
}

// The mass of a mixture is the share of its draws that fall inside.
TEST(BoxProbability, MixtureMassIsTheShareOfDraws) {
  Eigen::Matrix2d wide;
  wide << 1, 0.7, 0.7, 2;
  const std::vector<MixtureComponent> components{
      {.weight = 0.3, .mean = Eigen::Vector2d(0, 0), .covariance = wide},
      {.weight = 0.7,
       .mean = Eigen::Vector2d(1, 1),
       .covariance = 0.2 * Eigen::Matrix2d::Identity()}};
  const GaussianMixture mixture(components);
  const Eigen::Vector2d low(-0.5, -1);
  const Eigen::Vector2d high(1.2, 1);
  PhiloxStream stream({.seed = 2});
  constexpr int kN = 200000;
  int inside = 0;
  for (int i = 0; i < kN; ++i) {
    const Eigen::VectorXd x = mixture.Draw(stream);
    inside += (x.array() > low.array()).all() && (x.array() < high.array()).all();
  }
  EXPECT_NEAR(std::exp(mixture.LogBoxMass(low, high)), static_cast<double>(inside) / kN,
              5 * 0.5 / std::sqrt(kN));
}

}  // namespace
}  // namespace calib::inference
