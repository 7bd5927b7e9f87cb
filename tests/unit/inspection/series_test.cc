#include "server/inspection/series.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/inspection/tables.h"

namespace calib::inspection {
namespace {

Curve Hyperbola(int n, double noise, double memory) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Curve curve;
  double error = 0;
  for (int i = 0; i < n; ++i) {
    const double x = 0.1 * i / n;
    error = memory * error + std::sqrt(1 - memory * memory) * noise * normal(random);
    curve.control.push_back(x);
    curve.values.push_back(400 * x / (x + 0.02) + error);
  }
  return curve;
}

// Sampling error of a median over 400 readings is some 6 %; four of them.
TEST(Series, NoiseIsFoundOnACurveThatBends) {
  EXPECT_NEAR(NoiseOf(Hyperbola(400, 1.0, 0)), 1.0, 0.25);
  EXPECT_NEAR(NoiseOf(Hyperbola(400, 0.1, 0)), 0.1, 0.025);
}

TEST(Series, ReadingsThatRememberSayLess) {
  const double white = IndependentReadings(Hyperbola(600, 1, 0));
  EXPECT_GT(white, 400);
  // Errors of memory r count as n (1 - r)/(1 + r); a smooth curve takes some of them with it.
  const double kept = IndependentReadings(Hyperbola(600, 1, 0.8));
  EXPECT_GT(kept, 600 / 9.0 / 1.5);
  EXPECT_LT(kept, 3 * 600 / 9.0);
}

TEST(Series, RoundingHasAStep) {
  std::vector<double> values;
  for (int i = 0; i < 50; ++i) values.push_back(0.04 * std::floor(i / 3.0));
  ASSERT_TRUE(QuantumOf(values).has_value());
  EXPECT_NEAR(*QuantumOf(values), 0.04, 1e-9);
  EXPECT_FALSE(QuantumOf(Hyperbola(50, 1, 0).values).has_value());
}

TEST(Series, APauseIsAFallThatComesBack) {
  Curve curve = Hyperbola(200, 0.1, 0);
  curve.control[100] = curve.control[99];
  curve.values[100] = curve.values[99] - 2;
  EXPECT_EQ(DipsOf(curve, NoiseOf(curve)), std::vector<std::size_t>{100});
  // A curve that falls for good has none.
  for (std::size_t i = 120; i < 200; ++i) curve.values[i] = curve.values[119] - 0.8 * (i - 119.0);
  EXPECT_EQ(DipsOf(curve, NoiseOf(curve)), std::vector<std::size_t>{100});
}

TEST(Series, DoubledTurningRowsAreSaid) {
  const Inspection inspection = InspectText(
      "eps1[%],q[kPa]\n0,0\n1,100\n2,150\n2,150\n1.5,90\n1,30\n1,30\n1.5,90\n2,148\n3,180\n");
  EXPECT_TRUE(Says(inspection, FindingKind::kDuplicateControl, "2 of 10 rows"));
  EXPECT_TRUE(Says(inspection, FindingKind::kDuplicateControl, "2 of them where the path turns"));
  EXPECT_TRUE(Says(inspection, FindingKind::kUnloading, "2 times"));
}

}  // namespace
}  // namespace calib::inspection
