// Scatter between packings that is known from few of them: the laws and the covariances.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "inference/diagnosis/drawn_tail.h"
#include "inference/diagnosis/fall_tail.h"
#include "inference/sampling/philox.h"
#include "inference/scatter/chi_squared_law.h"
#include "inference/scatter/packing_scatter.h"

namespace calib::inference {
namespace {

using Eigen::Index;

PhiloxStream FewStream(int sample) {
  return PhiloxStream({.seed = 3,
                       .purpose = StreamPurpose::kDiagnosisNull,
                       .iteration = 0,
                       .sample = static_cast<std::uint64_t>(sample)});
}

// Squares of `dimensions` normal numbers, times a factor for each group.
Eigen::VectorXd Squares(const std::vector<double>& factors, int each, int dimensions) {
  Eigen::VectorXd drawn(static_cast<Index>(factors.size()) * each);
  PhiloxStream stream = FewStream(0);
  for (Index i = 0; i < drawn.size(); ++i) {
    double sum = 0;
    for (int d = 0; d < dimensions; ++d) sum += std::pow(stream.Normal(), 2);
    drawn[i] = factors[static_cast<std::size_t>(i / each)] * sum;
  }
  return drawn;
}

std::vector<int> GroupNumbers(int count, int each) {
  std::vector<int> group(static_cast<std::size_t>(count * each));
  for (std::size_t i = 0; i < group.size(); ++i) group[i] = static_cast<int>(i) / each;
  return group;
}

TEST(DrawnTail, OfOneGroupIsGamma) {
  const Eigen::VectorXd drawn = Squares({1}, 4000, 20);
  const DrawnTail tail(drawn, {});
  for (const double square : {5.0, 20.0, 31.4, 50.0}) {
    EXPECT_NEAR(tail(square), boost::math::gamma_q(10, square / 2), 0.02);
  }
  EXPECT_NEAR(tail.mean(), 20, 0.5);
  EXPECT_EQ(DrawnTail(Eigen::VectorXd::Constant(10, 3.0), {})(100), 1);
}

TEST(DrawnTail, OfGroupsThatDifferByChanceIsGamma) {
  const Eigen::VectorXd drawn = Squares({1, 1, 1, 1}, 1000, 20);
  const DrawnTail grouped(drawn, GroupNumbers(4, 1000));
  const DrawnTail whole(drawn, {});
  for (const double square : {10.0, 20.0, 31.4, 50.0}) {
    EXPECT_NEAR(grouped(square), whole(square), 0.03);
  }
}

// Groups far apart, hardly any spread within: Student's law of the logarithm.
TEST(DrawnTail, OfGroupsFarApartIsStudents) {
  const Eigen::VectorXd drawn = Squares({1, 2, 4, 8}, 100, 4000);
  const DrawnTail tail(drawn, GroupNumbers(4, 100));
  const double mean = std::log(4000.0) + 1.5 * std::log(2.0);
  const double sd = std::log(2.0) * std::sqrt(5.0 / 3 * 1.25);
  const boost::math::students_t law(3);
  for (const double t : {-2.0, 0.0, 1.0, 3.0, 10.0, 100.0}) {
    const double expected = boost::math::cdf(boost::math::complement(law, t));
    EXPECT_NEAR(tail(std::exp(mean + t * sd)) / expected, 1, 0.12) << t;
  }
  EXPECT_NEAR(tail(0), 1, 1e-9);
}

TEST(DrawnTail, WhereDrawsKnowTheirCovarianceIsFishers) {
  const Eigen::VectorXd drawn = Squares({1}, 4000, 20);
  const DrawnTail tail(drawn, {}, 2);
  const boost::math::fisher_f law(20, 2);
  for (const double ratio : {0.5, 1.0, 3.0, 30.0}) {
    EXPECT_NEAR(tail(20 * ratio), boost::math::cdf(boost::math::complement(law, ratio)), 0.01);
  }
}

TEST(ChanceOfFall, IsCountedWhereSimulationsReachAndLongerTailedWithFewPackings) {
  Falls falls{.simulated = {}, .freedom = 1, .packings = 0, .left_out = true};
  PhiloxStream stream = FewStream(1);
  for (int i = 0; i < 400; ++i) falls.simulated.push_back(std::pow(stream.Normal(), 2));
  const double common = ChanceOfFall(1, falls);
  EXPECT_NEAR(common, 0.317, 0.07);
  const double rare = ChanceOfFall(16, falls);
  EXPECT_LT(rare, 1e-3);
  falls.packings = 4;
  EXPECT_EQ(ChanceOfFall(1, falls), common);
  EXPECT_GT(ChanceOfFall(16, falls), 3 * rare);
  EXPECT_GT(ChanceOfFall(16, falls), ChanceOfFall(30, falls));
  falls.left_out = false;
  falls.packings = 2;
  EXPECT_GT(ChanceOfFall(16, falls), 0.1);  // a single degree of freedom: Cauchy's law
}

// The square of a normal number where it is positive, else nothing: half a point mass at zero. On
// average the tail is a little too long, as the anchor counts one more than its ten; as one
// chi-squared it is 0.85 and 0.6 of what it should be.
TEST(ChanceOfFall, OfWhatHasOneSignIsHalfOfItsSquaresTail) {
  constexpr int kSets = 100;
  for (const double chance : {1e-3, 1e-4}) {
    const double fall = std::pow(boost::math::quantile(boost::math::normal(), 1 - chance), 2);
    double ratio = 0;
    for (int set = 0; set < kSets; ++set) {
      PhiloxStream stream = FewStream(100 + set);
      Falls one_sign{.simulated = {}, .freedom = 1, .packings = 0, .left_out = true};
      Falls squares = one_sign;
      for (int i = 0; i < 1000; ++i) {
        const double normal = stream.Normal();
        one_sign.simulated.push_back(std::pow(std::max(0.0, normal), 2));
        if (normal > 0) squares.simulated.push_back(normal * normal);
      }
      const double half = (1.0 + squares.simulated.size()) / (1.0 + one_sign.simulated.size());
      const double found = ChanceOfFall(fall, one_sign);
      EXPECT_NEAR(found, half * ChanceOfFall(fall, squares), 1e-9 * chance);
      ratio += std::log(found / chance) / kSets;
    }
    EXPECT_GT(std::exp(ratio), 1) << chance;
    EXPECT_LT(std::exp(ratio), 1.6) << chance;
  }
}

TEST(ChanceOfFall, OfOneSignOnFewPackingsIsHalfOfFishersTail) {
  Falls falls{.simulated = {}, .freedom = 1, .packings = 5, .left_out = false};
  for (int i = 0; i < 4000; ++i) falls.simulated.push_back(i % 2 == 0 ? 1.0 : 0.0);
  const boost::math::fisher_f law(1, 4);
  EXPECT_NEAR(ChanceOfFall(30, falls), 0.5 * boost::math::cdf(complement(law, 30)), 1e-5);
}

TEST(ChiSquaredLaw, WhereTheCovarianceIsKnownIsTheUsualOne) {
  const Eigen::MatrixXd covariance = 2 * Eigen::MatrixXd::Identity(10, 10);
  for (const int packings : {0, 5}) {
    const KnownFrom known = WhatIsKnown(covariance, Eigen::MatrixXd::Zero(10, 10), packings);
    EXPECT_TRUE(std::isinf(known.Freedom()));
    EXPECT_DOUBLE_EQ(UpperTail(18.3, 10, known), boost::math::gamma_q(5, 9.15));
    EXPECT_NEAR(NormalDeviate(18.307, 10, known), 1.645, 0.01);
    EXPECT_NEAR(NormalDeviate(3.94, 10, known), -1.645, 0.01);
  }
  EXPECT_EQ(NormalDeviateOfMean(-3, 0, 4), -3);
  EXPECT_EQ(NormalDeviateOfMean(-3, 1, 0), -3);
}

// Nothing but scatter, seen on five packings: Fisher's law of 4, Student's of 4.
TEST(ChiSquaredLaw, WhereAllIsScatterFollowsThePackings) {
  const Eigen::MatrixXd covariance = 2 * Eigen::MatrixXd::Identity(10, 10);
  const KnownFrom known = WhatIsKnown(covariance, covariance, 5);
  EXPECT_NEAR(known.Freedom(), 4, 1e-12);
  EXPECT_NEAR(UpperTail(59.6, 10, known), 0.05, 0.001);  // F(10, 4) of 95 %: 5.96
  EXPECT_NEAR(NormalDeviate(59.6, 10, known), 1.645, 0.05);
  EXPECT_NEAR(NormalDeviateOfMean(2.132, 1, 5), 1.645, 0.001);  // t(4) of 95 %
  EXPECT_NEAR(NormalDeviateOfMean(-2.132, 1, 5), -1.645, 0.001);
  EXPECT_LT(NormalDeviateOfMean(2.132, 0.5, 5), 2.132);
  EXPECT_GT(NormalDeviateOfMean(2.132, 0.5, 5), 1.9);
}

// Half of the variance of every reading: a quarter of the size's square.
TEST(ChiSquaredLaw, NoiseBesideScatterMakesItBetterKnown) {
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(10, 10);
  KnownFrom known = WhatIsKnown(2 * one, one, 5);
  EXPECT_NEAR(known.Freedom(), 16, 1e-12);
  known += WhatIsKnown(one, 0 * one, 0);
  EXPECT_EQ(known.packings, 5);
  EXPECT_NEAR(known.Freedom(), 32, 1e-12);
}

// What a packing departs by is not in the covariance that it is judged by.
TEST(PackingScatter, LeavesAPackingOutWholly) {
  constexpr Index kFewReadings = 3;
  const std::vector<int> packing{7, 2, 9, 4, 7, 2, 9, 4};
  const Eigen::MatrixXd rest = 0.1 * Eigen::MatrixXd::Identity(kFewReadings, kFewReadings);
  const auto judged = [&](double of_nine) {
    Eigen::MatrixXd runs(8, kFewReadings);
    PhiloxStream stream = FewStream(2);
    for (double& value : runs.reshaped()) value = stream.Normal();
    for (const Index row : {2, 6}) runs(row, 1) += of_nine;
    // About the mean over all, which holds what is special of the ninth.
    const Eigen::MatrixXd departures = runs.rowwise() - runs.colwise().mean();
    return ScatterBetweenPackings(
        departures, packing,
        [&](std::optional<int> left_out) {
          Eigen::VectorXd variance = Eigen::VectorXd::Constant(kFewReadings, 1);
          if (left_out != 9) variance[1] += of_nine * of_nine;
          return Eigen::MatrixXd(variance.asDiagonal());
        },
        rest);
  };
  const PackingScatter plain = judged(0);
  const PackingScatter special = judged(100);
  EXPECT_EQ(plain.group, (std::vector<int>{2, 0, 3, 1, 2, 0, 3, 1}));
  ASSERT_EQ(plain.without.size(), 4U);
  EXPECT_TRUE(special.without[3].isApprox(plain.without[3], 1e-9));
  EXPECT_GT(special.without[0](1, 1), 100 * plain.without[0](1, 1));
  EXPECT_GT(special.covariance(1, 1), 100 * plain.covariance(1, 1));
}

}  // namespace
}  // namespace calib::inference
