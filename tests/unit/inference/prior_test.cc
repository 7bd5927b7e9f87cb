#include "inference/prior/prior.h"

#include <gtest/gtest.h>

#include <cmath>

#include "inference/numerics/standard_normal.h"

namespace calib::inference {
namespace {

const Prior kUniform{.kind = PriorKind::kUniform, .min = -1, .max = 3};
const Prior kLogUniform{.kind = PriorKind::kLogUniform, .min = 1e8, .max = 1e11};
const Prior kNormal{.kind = PriorKind::kNormal, .mean = 2, .sd = 0.5};
const Prior kHalfNormal{.kind = PriorKind::kNormal, .min = 0, .mean = 0, .sd = 2};
const Prior kFarTail{.kind = PriorKind::kNormal, .min = 12, .max = 13, .mean = 0, .sd = 1};
const Prior kLogNormal{.kind = PriorKind::kLogNormal, .mean = 1, .sd = 0.3};
const Prior kTruncatedLogNormal{
    .kind = PriorKind::kLogNormal, .min = 2, .max = 5, .mean = 1, .sd = 0.3};

class EachPrior : public testing::TestWithParam<Prior> {};
INSTANTIATE_TEST_SUITE_P(Prior, EachPrior,
                         testing::Values(kUniform, kLogUniform, kNormal, kHalfNormal, kFarTail,
                                         kLogNormal, kTruncatedLogNormal));

TEST_P(EachPrior, IsValid) { EXPECT_TRUE(GetParam().Validate().ok()) << GetParam().Validate(); }

// The quantile function and the density describe the same distribution: dQ/du = 1 / p(Q(u)).
TEST_P(EachPrior, QuantileSlopeIsReciprocalDensity) {
  const Prior& prior = GetParam();
  for (const double u : {0.001, 0.05, 0.3, 0.5, 0.7, 0.95, 0.999}) {
    const double h = 1e-4 * std::min(u, 1 - u);
    const double slope = (prior.Quantile(u + h) - prior.Quantile(u - h)) / (2 * h);
    EXPECT_NEAR(std::log(slope), -prior.LogDensity(prior.Quantile(u)), 1e-6) << "u = " << u;
  }
}

TEST_P(EachPrior, MassInsideTheBoundsIsOne) {
  const Prior& prior = GetParam();
  // Trapezoids between quantiles 1e-6 apart from the ends, in the density itself.
  constexpr int kCells = 20000;
  const double low = prior.Quantile(1e-9);
  const double high = prior.Quantile(1 - 1e-9);
  double mass = 0;
  for (int i = 0; i < kCells; ++i) {
    const bool log = prior.kind == PriorKind::kLogUniform;
    const auto at = [&](double f) {
      return log ? low * std::pow(high / low, f) : low + f * (high - low);
    };
    const double a = at(static_cast<double>(i) / kCells);
    const double b = at(static_cast<double>(i + 1) / kCells);
    mass += (b - a) * std::exp(prior.LogDensity(0.5 * (a + b)));
  }
  EXPECT_NEAR(mass, 1, 1e-5);
}

TEST_P(EachPrior, StandardCoordinateReturns) {
  const Prior& prior = GetParam();
  for (const double u : {0.01, 0.4, 0.99}) {
    const double x = prior.Quantile(u);
    EXPECT_NEAR(prior.FromStandard(prior.ToStandard(x)), x, 1e-12 * std::abs(x));
    const double h = 1e-6 * std::abs(x);
    const double slope = (prior.ToStandard(x + h) - prior.ToStandard(x - h)) / (2 * h);
    EXPECT_NEAR(std::log(slope), prior.LogJacobian(x), 1e-7);
  }
}

// Standardised: zero mean and unit sd, by the midpoint rule over the quantiles.
TEST_P(EachPrior, StandardCoordinateHasUnitMoments) {
  const Prior& prior = GetParam();
  constexpr int kStrips = 100000;
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < kStrips; ++i) {
    const double s = prior.ToStandard(prior.Quantile((i + 0.5) / kStrips));
    sum += s;
    squares += s * s;
  }
  EXPECT_NEAR(sum / kStrips, 0, 1e-4);
  EXPECT_NEAR(squares / kStrips, 1, 1e-3);
}

TEST(Prior, DensityOutsideTheSupportIsZero) {
  EXPECT_EQ(kUniform.LogDensity(3.0001), -INFINITY);
  EXPECT_EQ(kLogNormal.LogDensity(-1), -INFINITY);
  EXPECT_EQ(kHalfNormal.LogDensity(-1e-9), -INFINITY);
  EXPECT_EQ(kUniform.LogDensity(NAN), -INFINITY);
}

// Phi^-1 in a tail where Phi itself rounds to one.
TEST(Prior, QuantileOfAFarTailKeepsItsDigits) {
  const double x = kFarTail.Quantile(0.5);
  // The defining equation, in logs: Phi(-x) = (Phi(-12) + Phi(-13)) / 2.
  const double log_sum =
      std::log(0.5 * (std::erfc(12 / std::sqrt(2)) + std::erfc(13 / std::sqrt(2))) / 2);
  EXPECT_NEAR(LogNormalCdf(-x), log_sum, 1e-12);
  EXPECT_GT(x, 12.05);
  EXPECT_LT(x, 12.06);
}

TEST(Prior, QuantileBeyondTheRangeOfErfc) {
  const Prior prior{.kind = PriorKind::kNormal, .min = 50, .mean = 0, .sd = 1};
  ASSERT_TRUE(prior.Validate().ok());
  // Tail beyond a = 50 is nearly exponential with rate a: Q(u) = a - ln(1 - u) / a (1 + O(1/a^2)).
  EXPECT_NEAR(prior.Quantile(0.5), 50 + std::log(2) / 50, 2e-5);
  EXPECT_NEAR(prior.Quantile(1e-9), 50 + 1e-9 / 50, 1e-12);
}

TEST(Prior, BadInputIsRefusedWithASentence) {
  const auto message = [](const Prior& prior) { return std::string(prior.Validate().message()); };
  EXPECT_NE(message({.kind = PriorKind::kUniform, .min = 2, .max = 1}), "");
  EXPECT_NE(message({.kind = PriorKind::kUniform, .min = 0}), "");
  EXPECT_NE(message({.kind = PriorKind::kLogUniform, .min = 0, .max = 1}), "");
  EXPECT_NE(message({.kind = PriorKind::kNormal, .sd = 0}), "");
  EXPECT_NE(message({.kind = PriorKind::kNormal, .mean = NAN}), "");
  EXPECT_NE(message({.kind = PriorKind::kLogNormal, .max = 0}), "");
  EXPECT_NE(message({.kind = PriorKind::kUniform, .min = NAN, .max = 1}), "");
}

TEST(Prior, StandardDeviationOfLogPriorIsThatOfX) {
  // Log-normal: sd^2 = (exp(s^2) - 1) exp(2 m + s^2).
  const double expected = std::sqrt(std::expm1(0.09) * std::exp(2 + 0.09));
  EXPECT_NEAR(kLogNormal.StandardDeviation(), expected, 1e-12 * expected);
  // Truncated where it does not matter: by quadrature.
  Prior far = kLogNormal;
  far.max = 1e6;
  EXPECT_NEAR(far.StandardDeviation(), expected, 3e-3 * expected);
}

// ln Phi against 30-digit values.
TEST(StandardNormal, LogCdf) {
  EXPECT_NEAR(LogNormalCdf(0), std::log(0.5), 1e-16);
  EXPECT_NEAR(LogNormalCdf(-10), -53.23128515051247, 1e-13 * 53);
  EXPECT_NEAR(LogNormalCdf(-40), -804.6084420137538, 1e-13 * 804);
  EXPECT_NEAR(LogNormalCdf(6), -9.865876455243757e-10, 1e-23);
  EXPECT_NEAR(LogNormalCdf(-36.999999), LogNormalCdf(-37.000001), 1e-4);
}

TEST(StandardNormal, LogMassOfNarrowAndFarIntervals) {
  EXPECT_NEAR(LogNormalMass(-1, 1), std::log(0.6826894921370859), 1e-15);
  EXPECT_NEAR(LogNormalMass(1, 1 + 1e-9), LogNormalDensity(1) + std::log(1e-9), 1e-7);
  EXPECT_NEAR(LogNormalMass(20, 21), LogNormalMass(-21, -20), 1e-13);
  EXPECT_NEAR(LogNormalMass(20, INFINITY), LogNormalCdf(-20), 1e-13);
  EXPECT_EQ(LogNormalMass(2, 2), -INFINITY);
}

}  // namespace
}  // namespace calib::inference
