#include "server/scheduler/leases/arrival_rate.h"

#include <gtest/gtest.h>

namespace calib::scheduler {
namespace {

using Time = ArrivalRate::Time;

Time At(double seconds) {
  return Time(std::chrono::milliseconds(static_cast<std::int64_t>(1000 * seconds)));
}

TEST(ArrivalRate, IsWhatCameInOverWholeSecondsOfTheLastTen) {
  ArrivalRate rate;
  EXPECT_EQ(rate.PerSecond(At(100)), 0) << "no second is over";
  for (int second = 100; second < 120; ++second) rate.Add(At(second + 0.3), 50);
  EXPECT_EQ(rate.PerSecond(At(119.9)), 50) << "the second that goes on does not count";
  EXPECT_EQ(rate.PerSecond(At(120)), 50);
  EXPECT_EQ(rate.PerSecond(At(125)), 25);
  EXPECT_EQ(rate.PerSecond(At(130)), 0);
}

TEST(ArrivalRate, OfTheFirstSecondsIsOverThese) {
  ArrivalRate rate;
  rate.Add(At(7.5), 30);
  EXPECT_EQ(rate.PerSecond(At(7.9)), 0);
  EXPECT_EQ(rate.PerSecond(At(8)), 30);
  EXPECT_EQ(rate.PerSecond(At(9)), 15);
  rate.Add(At(1000), 4);
  EXPECT_EQ(rate.PerSecond(At(1001)), 0.4) << "what is long over is forgotten";
}

TEST(ArrivalRate, HasCeasedOnceAfterTheLast) {
  ArrivalRate rate;
  EXPECT_FALSE(rate.HasCeased(At(5)));
  rate.Add(At(5), 1);
  EXPECT_FALSE(rate.HasCeased(At(15)));
  EXPECT_TRUE(rate.HasCeased(At(16.5)));
  EXPECT_FALSE(rate.HasCeased(At(17)));
  rate.Add(At(18), 1);
  EXPECT_TRUE(rate.HasCeased(At(90)));
}

}  // namespace
}  // namespace calib::scheduler
