#include "inference/mixture/box_probability.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iostream>
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

/// P(low < x_k < high for all k) of d standard normals that are all correlated by r: given the
/// common part t they are independent. Trapezoidal rule, which converges faster than any power of
/// the step here.
double Equicorrelated(int d, double r, double low, double high) {
  constexpr double kStep = 0.02;
  constexpr double kReach = 9;
  const auto cdf = [](double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); };
  double sum = 0;
  const int steps = static_cast<int>(std::lround(2 * kReach / kStep));
  for (int k = 0; k <= steps; ++k) {
    const double t = -kReach + kStep * k;
    const double scale = 1 / std::sqrt(1 - r);
    const double shift = std::sqrt(r) * t;
    const double inside = cdf((high - shift) * scale) - cdf((low - shift) * scale);
    sum += std::exp(-0.5 * t * t) * std::pow(inside, d);
  }
  return sum * kStep / std::sqrt(2 * std::numbers::pi);
}

// The points are fixed, so that the error of one box says little: its root mean square over many
// boxes does. Limits are half as much again as what is found, printed by the test.
TEST(BoxProbability, ErrorOverManyCorrelatedBoxes) {
  ASSERT_NEAR(Equicorrelated(6, 0.5, 0, 40), 1.0 / 7, 1e-12);
  const struct {
    int d;
    double rms, largest;
  } limits[] = {{2, 7e-5, 2.1e-4}, {3, 2.6e-4, 8.7e-4}, {6, 1.45e-3, 5.7e-3}};
  for (const auto& limit : limits) {
    double squares = 0;
    double largest = 0;
    int boxes = 0;
    for (const double r : {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}) {
      Eigen::MatrixXd covariance = Eigen::MatrixXd::Constant(limit.d, limit.d, r);
      covariance.diagonal().setOnes();
      const Eigen::MatrixXd cholesky = covariance.llt().matrixL();
      for (const double low : {-2.0, -1.0, -0.5, 0.0, 0.5}) {
        for (const double high : {1.0, 2.5, 40.0}) {
          const double exact = Equicorrelated(limit.d, r, low, high);
          const double found = BoxProbability(cholesky, Eigen::VectorXd::Constant(limit.d, low),
                                              Eigen::VectorXd::Constant(limit.d, high));
          const double error = found / exact - 1;
          squares += error * error;
          largest = std::max(largest, std::abs(error));
          ++boxes;
        }
      }
    }
    const double rms = std::sqrt(squares / boxes);
    std::cout << limit.d << " dimensions, " << boxes << " boxes: relative error rms " << rms
              << ", at most " << largest << "\n";
    EXPECT_LT(rms, limit.rms) << limit.d;
    EXPECT_LT(largest, limit.largest) << limit.d;
  }
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
