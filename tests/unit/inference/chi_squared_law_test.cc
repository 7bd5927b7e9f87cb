// Laws of a chi-squared and of a mean whose covariance few packings show.
#include "inference/scatter/chi_squared_law.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

namespace calib::inference {
namespace {

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

}  // namespace
}  // namespace calib::inference
