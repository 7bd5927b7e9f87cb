#include "server/report/views/residual_pattern.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "server/report/views/residual_words.h"

namespace calib::report {
namespace {

// 40 readings of a curve that rises and saturates; errors of 1 % of its height.
ResidualCurve Curve() {
  constexpr int kPatternReadings = 40;
  ResidualCurve curve{.residual = Eigen::VectorXd::Zero(kPatternReadings),
                      .sd = Eigen::VectorXd::Constant(kPatternReadings, 0.01),
                      .correlation = Eigen::VectorXd::Zero(kPatternReadings),
                      .control = Eigen::VectorXd::LinSpaced(kPatternReadings, 0.0025, 0.1),
                      .model = {}};
  curve.model = 1 - (-30 * curve.control.array()).exp();
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 0.01);
  for (double& r : curve.residual) r = noise(random);
  return curve;
}

TEST(ResidualPattern, NoiseHasNone) {
  int named = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    ResidualCurve curve = Curve();
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 0.01);
    for (double& r : curve.residual) r = noise(random);
    named += PatternOf(curve).shape != ResidualShape::kNone ? 1 : 0;
  }
  EXPECT_LE(named, 8);  // 2 expected at a level of 1 %
}

TEST(ResidualPattern, NamesEachShapeAndItsSize) {
  ResidualCurve offset = Curve();
  offset.residual.array() += 0.02;
  EXPECT_EQ(PatternOf(offset).shape, ResidualShape::kOffset);
  EXPECT_NEAR(PatternOf(offset).size, 0.02, 0.005);

  ResidualCurve slope = Curve();
  slope.residual += -0.8 * (slope.control.array() - slope.control.mean()).matrix();
  EXPECT_EQ(PatternOf(slope).shape, ResidualShape::kSlope);
  EXPECT_NEAR(PatternOf(slope).size, -0.8, 0.2);

  ResidualCurve amplitude = Curve();
  amplitude.residual += 0.06 * amplitude.model;
  EXPECT_EQ(PatternOf(amplitude).shape, ResidualShape::kAmplitude);
  EXPECT_NEAR(PatternOf(amplitude).size, 0.06, 0.01);

  ResidualCurve lag = Curve();  // the model's strain axis is behind by 0.3 %
  lag.residual += (-30 * (lag.control.array())).exp().matrix() * (-30 * 0.003);
  EXPECT_EQ(PatternOf(lag).shape, ResidualShape::kLag);
  EXPECT_NEAR(PatternOf(lag).size, 0.003, 0.001);

  ResidualCurve irregular = Curve();
  for (Eigen::Index i = 0; i < irregular.residual.size(); ++i) {
    irregular.residual[i] += i % 2 == 0 ? 0.05 : -0.05;
  }
  EXPECT_EQ(PatternOf(irregular).shape, ResidualShape::kIrregular);
}

TEST(ResidualPattern, WhiteningGivesChiSquaredOfTheChain) {
  ResidualCurve curve = Curve();
  curve.correlation.setConstant(0.7);
  const Eigen::Index n = curve.residual.size();
  Eigen::MatrixXd covariance(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      covariance(i, j) = 1e-4 * std::pow(0.7, static_cast<double>(std::abs(i - j)));
    }
  }
  const double exact = curve.residual.dot(covariance.ldlt().solve(curve.residual));
  EXPECT_NEAR(Whitened(curve, curve.residual).squaredNorm(), exact, 1e-9 * exact);
}

TEST(ResidualWords, SayStageSignAndShape) {
  Comparison comparison;
  SegmentMisfit stage{.experiment = "tx",
                      .observable = "q_over_p",
                      .segment = "post_peak",
                      .from = 0.04,
                      .to = 0.1,
                      .bias = -0.08,
                      .z = -9,
                      .readings = 20,
                      .rms_error = 4,
                      .chi2_share = 0.8};
  stage.pattern = {.shape = ResidualShape::kOffset, .size = -0.08, .z = -9, .explained = 0.9};
  comparison.by_segment = {stage};
  const auto said = WhereItFails(comparison);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_NE(said[0].find("post peak: the model is too low by 0.08"), std::string::npos) << said[0];
  EXPECT_NE(said[0].find("constant offset"), std::string::npos) << said[0];
  EXPECT_TRUE(WhereItFails({}).empty());
}

}  // namespace
}  // namespace calib::report
