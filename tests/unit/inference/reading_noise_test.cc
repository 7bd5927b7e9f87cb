// Rates of wrong answers on simulated curves, and what is found.
#include "inference/data/reading_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace calib::inference {
namespace {

constexpr int kCurves = 1000;

using Curve = std::function<double(double)>;  // over [0, 1]

// A triaxial curve: a steep rise over a tenth of the path, a plateau that softens.
double Strength(double s) { return 3 * (1 - std::exp(-20 * s)) * (1 - 0.2 * s); }

struct Simulated {
  int readings = 40;
  double stated = 0.02;      // sd
  double noise = 0.02;       // sd
  double length = 0;         // correlation of the errors that are made, in readings
  double stated_length = 0;  // and of those that are said
  double step = 0;           // values are rounded to
};

ReadingRun Simulate(const Simulated& how, const Curve& curve, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Eigen::Index n = how.readings;
  ReadingRun run{.values = Eigen::VectorXd(n), .covariance = Eigen::MatrixXd::Zero(n, n)};
  const double keep = how.length > 0 ? std::exp(-1 / how.length) : 0;
  double error = normal(random);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (i > 0) error = keep * error + std::sqrt(1 - keep * keep) * normal(random);
    double value = curve(static_cast<double>(i) / static_cast<double>(n - 1)) + how.noise * error;
    if (how.step > 0) value = how.step * std::round(value / how.step);
    run.values[i] = value;
    for (Eigen::Index j = 0; j < n; ++j) {
      const double apart = std::abs(static_cast<double>(i - j));
      const double correlation =
          how.stated_length > 0 ? std::exp(-apart / how.stated_length) : (i == j ? 1 : 0);
      run.covariance(i, j) = how.stated * how.stated * correlation;
    }
  }
  return run;
}

struct Rates {
  int larger = 0, smaller = 0;
};
Rates RatesOf(const Simulated& how, const Curve& curve, int runs = 1) {
  std::mt19937 random(11);
  Rates rates;
  for (int k = 0; k < kCurves; ++k) {
    std::vector<ReadingRun> measured;
    for (int r = 0; r < runs; ++r) measured.push_back(Simulate(how, curve, random));
    const auto noise = CompareReadingNoise(measured);
    EXPECT_TRUE(noise.ok()) << noise.status();
    rates.larger += noise->surely_larger ? 1 : 0;
    rates.smaller += noise->surely_smaller ? 1 : 0;
  }
  return rates;
}

// The error rate of the rule: none of 1000 curves whose errors are as stated, whatever their
// number of readings and correlation.
TEST(ReadingNoise, NothingIsSaidWhereErrorsAreAsStated) {
  for (const int readings : {16, 24, 40, 100}) {
    for (const double length : {0.0, 3.0}) {
      Simulated how{.readings = readings, .length = length, .stated_length = length};
      const Rates rates = RatesOf(how, Strength);
      EXPECT_EQ(rates.larger, 0) << readings << " readings, correlated over " << length;
      EXPECT_EQ(rates.smaller, 0) << readings << " readings, correlated over " << length;
    }
  }
  const Rates several = RatesOf({.readings = 10}, Strength, 3);
  EXPECT_EQ(several.larger + several.smaller, 0);
}

// A curve that turns between two readings, or has a corner, is not noise.
TEST(ReadingNoise, TheCurveItselfIsNotTakenForNoise) {
  const Curve corner = [](double s) { return s < 0.5 ? 40 * s : 20 + 2 * (s - 0.5); };
  const Curve wave = [](double s) { return std::sin(12 * s); };  // two periods
  const Curve rise = [](double s) { return 3 * (1 - std::exp(-100 * s)); };
  for (const Curve& curve : {corner, wave, rise}) {
    for (const int readings : {20, 40}) {
      EXPECT_EQ(RatesOf({.readings = readings}, curve).larger, 0) << readings;
      EXPECT_EQ(RatesOf({.readings = readings, .noise = 0.002}, curve).larger, 0) << readings;
    }
  }
}

TEST(ReadingNoise, AThirdOrThreeTimesOfWhatIsStatedIsFound) {
  const Rates larger = RatesOf({.readings = 100, .noise = 0.06}, Strength);
  EXPECT_GT(larger.larger, 0.9 * kCurves);
  EXPECT_EQ(larger.smaller, 0);
  const Rates smaller = RatesOf({.readings = 100, .noise = 0.02 / 3}, Strength);
  EXPECT_GT(smaller.smaller, 0.9 * kCurves);
  EXPECT_EQ(smaller.larger, 0);
  // Errors over many readings that were said to be independent.
  EXPECT_GT(RatesOf({.readings = 60, .length = 60}, Strength).smaller, 0.9 * kCurves);
}

TEST(ReadingNoise, AFewReadingsSayNothing) {
  std::mt19937 random(1);
  const auto few = CompareReadingNoise({Simulate({.readings = 12, .noise = 1}, Strength, random)});
  ASSERT_TRUE(few.ok());
  EXPECT_GT(few->scale, 10);
  EXPECT_FALSE(few->surely_larger);
  EXPECT_TRUE(CompareReadingNoise({}).ok());
}

TEST(ReadingNoise, RefusesShapesThatDoNotFit) {
  EXPECT_FALSE(CompareReadingNoise({{.values = Eigen::VectorXd::Zero(30),
                                     .covariance = Eigen::MatrixXd::Identity(29, 29)}})
                   .ok());
  EXPECT_FALSE(CompareReadingNoise({{.values = Eigen::VectorXd::Zero(30),
                                     .covariance = Eigen::MatrixXd::Zero(30, 30)}})
                   .ok());
}

}  // namespace
}  // namespace calib::inference
