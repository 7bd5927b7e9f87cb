#include "server/scheduler/leases/lease_table.h"

#include <gtest/gtest.h>

namespace calib::scheduler {
namespace {

using std::chrono::seconds;

constexpr Clock::time_point kStart{};
constexpr store::EvaluationKey kKey{.campaign = 1, .sample = 2, .experiment = 0};

TEST(LeaseTable, LeaseLastsUntilNothingWasHeardForItsLength) {
  LeaseTable table(seconds(10));
  table.Grant(7, kKey, "w", kStart);
  EXPECT_TRUE(table.TakeExpired(kStart + seconds(10)).empty());
  EXPECT_TRUE(table.Renew(7, "w", kStart + seconds(10)));
  EXPECT_TRUE(table.TakeExpired(kStart + seconds(20)).empty());
  const auto expired = table.TakeExpired(kStart + seconds(21));
  ASSERT_EQ(expired.size(), 1U);
  EXPECT_EQ(expired.front().attempt, 7);
  EXPECT_EQ(expired.front().key, kKey);
  EXPECT_FALSE(table.Renew(7, "w", kStart + seconds(21))) << "what has expired stays lost";
}

TEST(LeaseTable, OnlyItsWorkerHoldsAnAttempt) {
  LeaseTable table(seconds(10));
  table.Grant(7, kKey, "w", kStart);
  EXPECT_FALSE(table.Renew(7, "other", kStart));
  EXPECT_EQ(table.Find(7, "other"), nullptr);
  ASSERT_NE(table.Find(7, "w"), nullptr);
  EXPECT_EQ(table.Busy("w"), 1);
  EXPECT_EQ(table.Busy("other"), 0);
}

TEST(LeaseTable, ReleasedAttemptIsGone) {
  LeaseTable table(seconds(10));
  table.Grant(7, kKey, "w", kStart);
  table.Grant(8, {.campaign = 2, .sample = 0, .experiment = 0}, "w", kStart);
  EXPECT_EQ(table.OfCampaign(1).size(), 1U);
  EXPECT_EQ(table.OfWorker("w").size(), 2U);
  EXPECT_TRUE(table.Release(7).has_value());
  EXPECT_FALSE(table.Release(7).has_value());
  EXPECT_EQ(table.OfCampaign(1).size(), 0U);
}

}  // namespace
}  // namespace calib::scheduler
