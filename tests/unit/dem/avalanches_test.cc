// Sizes of avalanches from the grains that had left when each arch formed.
#include "dem/measure/avalanches.h"

#include <gtest/gtest.h>

namespace calib::dem {
namespace {

TEST(Avalanches, LieBetweenArches) {
  Avalanches avalanches;
  EXPECT_EQ(avalanches.count(), 0U);
  avalanches.Block(7);
  avalanches.Block(7);  // the arch was not broken
  avalanches.Block(10);
  avalanches.Block(60);
  EXPECT_EQ(avalanches.count(), 3U);
  EXPECT_EQ(avalanches.Mean(), 20);
  EXPECT_EQ(avalanches.ExceededBy(0.5), 7);
  EXPECT_EQ(avalanches.ExceededBy(0.1), 50);
}

TEST(Avalanches, QuantilesAreExceededByTheirShare) {
  Avalanches avalanches;
  std::size_t left = 0;
  for (const std::size_t size : {3U, 9U, 1U, 7U, 10U, 2U, 8U, 4U, 6U, 5U}) {
    left += size;
    avalanches.Block(left);
  }
  EXPECT_EQ(avalanches.ExceededBy(0), 10);
  EXPECT_EQ(avalanches.ExceededBy(0.1), 9);  // one of ten exceeds it
  EXPECT_EQ(avalanches.ExceededBy(0.3), 7);
  EXPECT_EQ(avalanches.ExceededBy(0.5), 5);
}

}  // namespace
}  // namespace calib::dem
