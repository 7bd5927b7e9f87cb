#include "dem/particles/grading.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dem/particles/packing.h"
#include "dem/simulate/packing_generator.h"

namespace calib::dem {
namespace {

// A sand between a tenth and half a millimetre, with a gap.
const Grading kCurve = {{1e-4, 0}, {1.5e-4, 0.2}, {2.5e-4, 0.6}, {3.5e-4, 0.6}, {5e-4, 1}};

double FinerIn(const std::vector<double>& radii, double size) {
  double finer = 0;
  double all = 0;
  for (const double r : radii) {
    all += r * r * r;
    finer += r < size ? r * r * r : 0;
  }
  return finer / all;
}

// Straight between points in a semi-logarithmic plot.
double Along(const Grading& curve, double size) {
  if (size <= curve.front().radius) return 0;
  for (std::size_t k = 1; k < curve.size(); ++k) {
    const GradingPoint& a = curve[k - 1];
    const GradingPoint& b = curve[k];
    if (size <= b.radius) {
      return a.finer +
             (b.finer - a.finer) * std::log(size / a.radius) / std::log(b.radius / a.radius);
    }
  }
  return 1;
}

double FarthestOff(const std::vector<double>& radii, const Grading& curve) {
  double farthest = 0;
  for (int k = 0; k <= 1000; ++k) {
    const double size =
        curve.front().radius * std::pow(curve.back().radius / curve.front().radius, k / 1000.0);
    farthest = std::max(farthest, std::abs(FinerIn(radii, size) - Along(curve, size)));
  }
  return farthest;
}

TEST(Grading, AFewHundredGrainsFollowTheCurve) {
  for (const int grains : {100, 300, 1000, 20'000}) {
    const std::vector<double> radii = GradedRadii(kCurve, grains);
    ASSERT_EQ(radii.size(), static_cast<std::size_t>(grains));
    EXPECT_TRUE(std::is_sorted(radii.rbegin(), radii.rend()));
    EXPECT_GE(radii.back(), 1e-4);
    EXPECT_LE(radii.front(), 5e-4);
    const double off = FarthestOff(radii, kCurve);
    EXPECT_LE(off, LargestShare(radii)) << grains;
    EXPECT_LE(off, 11.0 / grains) << grains;  // 0.034 with 300
  }
}

TEST(Grading, GrainsOfOneSizeAreSpreadEvenly) {
  const std::vector<double> radii = GradedRadii({{0.99e-3, 0}, {1.01e-3, 1}}, 100);
  EXPECT_NEAR(LargestShare(radii), 0.01, 0.0004);
  EXPECT_NEAR(radii[50], 1e-3, 1e-6);
}

TEST(Grading, HalfOfTheMassOfALogNormalIsFinerThanItsMedian) {
  const double median = 2e-3;
  const double log_sd = 0.4;
  const Grading curve = LogNormalGrading(median, log_sd);
  ASSERT_TRUE(IsGrading(curve));
  EXPECT_NEAR(curve.front().radius, median * std::exp(-0.8), 1e-12);
  const std::vector<double> radii = GradedRadii(curve, 500);
  EXPECT_LE(FarthestOff(radii, curve), LargestShare(radii));
  const double inside = std::erf(std::sqrt(2.0));  // within two standard deviations
  for (const double z : {-1.5, -1.0, 0.0, 0.5, 1.0}) {
    const double normal = 0.5 + 0.5 * std::erf(z / std::sqrt(2.0)) / inside;
    EXPECT_NEAR(FinerIn(radii, median * std::exp(log_sd * z)), normal, 0.01) << z;
  }
}

TEST(Grading, ACurveRisesFromNothingToAll) {
  EXPECT_TRUE(IsGrading(kCurve));
  EXPECT_FALSE(IsGrading({{1e-3, 0}}));
  EXPECT_FALSE(IsGrading({{1e-3, 0.1}, {2e-3, 1}}));
  EXPECT_FALSE(IsGrading({{1e-3, 0}, {2e-3, 0.9}}));
  EXPECT_FALSE(IsGrading({{1e-3, 0}, {1e-3, 1}}));
  EXPECT_FALSE(IsGrading({{1e-3, 0}, {2e-3, 0.6}, {3e-3, 0.5}, {4e-3, 1}}));
  EXPECT_FALSE(IsGrading({{0, 0}, {2e-3, 1}}));
}

TEST(Grading, SizesOfAGradedSpecimenAreTheSameForEverySeed) {
  PackingRecipe recipe{.particles = 300, .mean_radius = 2e-4, .grading = kCurve};
  const auto one = GenerateSizes(recipe);
  recipe.seed = 2;
  const auto two = GenerateSizes(recipe);
  ASSERT_TRUE(one.ok() && two.ok());
  EXPECT_EQ(one->radius, GradedRadii(kCurve, 300));
  EXPECT_EQ(two->radius, one->radius);
  EXPECT_NE(two->x, one->x);
}

}  // namespace
}  // namespace calib::dem
