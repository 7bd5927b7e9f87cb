// Which refit the next batch of runs goes to.
#include "server/ctl/warm_fits.h"

#include <gtest/gtest.h>

#include <limits>

namespace calib::ctl {
namespace {

constexpr double kBase = 400;  // chi-squared of the model without any of the effects
constexpr double kUnknown = std::numeric_limits<double>::infinity();

TEST(PriceOf, AFitThatIsNotFoundYetIsWorthWhatTheScreenExpects) {
  const double poor_but_promising = PriceOf(3 * kBase, kBase, 0.2, 3);
  const double near_but_hopeless = PriceOf(0.8 * kBase, kBase, 0.95, 3);
  EXPECT_LT(poor_but_promising, near_but_hopeless);
}

TEST(PriceOf, WhatHasBeenReachedCountsWhereItIsMore) {
  EXPECT_LT(PriceOf(10, kBase, 0.9, 3), PriceOf(200, kBase, 0.9, 3));
}

TEST(PriceOf, NoPromiseMakesAFitWorseThanTheModelItContains) {
  EXPECT_EQ(PriceOf(kUnknown, kBase, 5, 2), PriceOf(kBase, kBase, 1, 2));
}

TEST(PriceOf, EveryBatchHasToPay) {
  EXPECT_LT(PriceOf(kBase, kBase, 0.5, 2), PriceOf(kBase, kBase, 0.5, 3));
  EXPECT_GT(PriceOf(kBase, kBase, 0.5, 6), PriceOf(kBase, kBase, 1, 3));
}

}  // namespace
}  // namespace calib::ctl
