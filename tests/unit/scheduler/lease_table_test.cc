#include "server/scheduler/leases/lease_table.h"

#include <gtest/gtest.h>

namespace calib::scheduler {
namespace {

using std::chrono::seconds;

constexpr Clock::time_point kStart{};
constexpr store::EvaluationKey kKey{.campaign = 1, .sample = 2, .experiment = 0};

LeaseEntry Lease(std::int64_t attempt, const std::string& worker,
                 const store::EvaluationKey& key = kKey) {
  return {.attempt = attempt, .key = key, .worker = worker, .started = kStart};
}

TEST(LeaseTable, LeaseLastsUntilNothingWasHeardForItsLength) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(7, "w"));
  EXPECT_TRUE(table.Expired(kStart + seconds(10)).empty());
  EXPECT_TRUE(table.Renew(7, "w", kStart + seconds(10)));
  EXPECT_TRUE(table.Expired(kStart + seconds(20)).empty());
  const auto expired = table.Expired(kStart + seconds(21));
  ASSERT_EQ(expired.size(), 1U);
  EXPECT_EQ(expired.front().attempt, 7);
  EXPECT_EQ(expired.front().key, kKey);
  EXPECT_TRUE(table.Release(7).has_value());
  EXPECT_TRUE(table.Expired(kStart + seconds(21)).empty());
  EXPECT_FALSE(table.Renew(7, "w", kStart + seconds(21))) << "what is released stays lost";
}

TEST(LeaseTable, OnlyItsWorkerHoldsAnAttempt) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(7, "w"));
  EXPECT_FALSE(table.Renew(7, "other", kStart));
  EXPECT_EQ(table.Find(7, "other"), nullptr);
  ASSERT_NE(table.Find(7, "w"), nullptr);
  EXPECT_EQ(table.Busy("w"), 1);
  EXPECT_EQ(table.Busy("other"), 0);
}

TEST(LeaseTable, ReleasedAttemptIsGone) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(7, "w"));
  table.Grant(Lease(8, "w", {.campaign = 2, .sample = 0, .experiment = 0}));
  EXPECT_EQ(table.OfCampaign(1).size(), 1U);
  EXPECT_EQ(table.OfWorker("w").size(), 2U);
  EXPECT_TRUE(table.Release(7).has_value());
  EXPECT_FALSE(table.Release(7).has_value());
  EXPECT_EQ(table.OfCampaign(1).size(), 0U);
  ASSERT_EQ(table.OfWorker("w").size(), 1U);
  EXPECT_EQ(table.OfWorker("w").front().attempt, 8);
  EXPECT_EQ(table.Busy("w"), 1);
}

TEST(LeaseTable, ExpiredLeasesComeInOrderOfAttemptWhateverEndsFirst) {
  LeaseTable table(seconds(10));
  for (const std::int64_t attempt : {9, 7, 8}) table.Grant(Lease(attempt, "w"));
  EXPECT_TRUE(table.Renew(7, "w", kStart + seconds(2)));
  EXPECT_TRUE(table.Renew(8, "w", kStart + seconds(1)));
  const auto expired = table.Expired(kStart + seconds(13));
  ASSERT_EQ(expired.size(), 3U);
  EXPECT_EQ(expired[0].attempt, 7);
  EXPECT_EQ(expired[2].attempt, 9);
}

}  // namespace
}  // namespace calib::scheduler
