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
  table.Heard("w", kStart + seconds(10));
  EXPECT_TRUE(table.Expired(kStart + seconds(20)).empty());
  const auto expired = table.Expired(kStart + seconds(21));
  ASSERT_EQ(expired.size(), 1U);
  EXPECT_EQ(expired.front().attempt, 7);
  EXPECT_EQ(expired.front().key, kKey);
  EXPECT_TRUE(table.Release(7).has_value());
  EXPECT_TRUE(table.Expired(kStart + seconds(21)).empty());
  EXPECT_FALSE(table.Named(7, "w", kStart + seconds(21))) << "what is released stays lost";
}

TEST(LeaseTable, OnlyItsWorkerHoldsAnAttempt) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(7, "w"));
  EXPECT_FALSE(table.Named(7, "other", kStart));
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

TEST(LeaseTable, ExpiredLeasesComeInOrderOfAttemptWhoeverFallsSilentFirst) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(9, "a"));
  table.Grant(Lease(7, "b"));
  table.Grant(Lease(8, "a"));
  table.Heard("b", kStart + seconds(2));
  const auto expired = table.Expired(kStart + seconds(13));
  ASSERT_EQ(expired.size(), 3U);
  EXPECT_EQ(expired[0].attempt, 7);
  EXPECT_EQ(expired[2].attempt, 9);
  EXPECT_EQ(table.Expired(kStart + seconds(13)).size(), 3U) << "until they are released";
}

TEST(LeaseTable, WhoIsHeardKeepsAllThatItHoldsButWhatItNeverNames) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(7, "w"));
  table.Grant(Lease(8, "w"));
  for (int t = 1; t <= 30; ++t) {
    table.Heard("w", kStart + seconds(t));
    EXPECT_TRUE(table.Named(7, "w", kStart + seconds(t)));
    EXPECT_TRUE(table.Expired(kStart + seconds(t)).empty());
  }
  EXPECT_TRUE(table.Unnamed("w", kStart + seconds(40)).empty());
  const auto unnamed = table.Unnamed("w", kStart + seconds(41));
  ASSERT_EQ(unnamed.size(), 1U);
  EXPECT_EQ(unnamed.front().attempt, 8);
}

TEST(LeaseTable, ALeaseGrantedLateLastsItsLength) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(7, "w"));
  LeaseEntry late = Lease(8, "w");
  late.started = kStart + seconds(8);
  table.Grant(late);
  auto expired = table.Expired(kStart + seconds(11));
  ASSERT_EQ(expired.size(), 1U);
  EXPECT_EQ(expired.front().attempt, 7);
  table.Release(7);
  EXPECT_TRUE(table.Expired(kStart + seconds(18)).empty());
  EXPECT_EQ(table.Expired(kStart + seconds(19)).size(), 1U);
}

TEST(LeaseTable, AfterAStandstillNothingEndsForALeaseTime) {
  LeaseTable table(seconds(10));
  table.Grant(Lease(7, "w"));
  table.Pardon(kStart + seconds(100));
  EXPECT_TRUE(table.Expired(kStart + seconds(110)).empty());
  EXPECT_TRUE(table.Unnamed("w", kStart + seconds(140)).empty());
  EXPECT_LE(table.HeardSince(kStart + seconds(109)), kStart) << "nobody is silent yet";
  EXPECT_EQ(table.Unnamed("w", kStart + seconds(141)).size(), 1U);
  EXPECT_EQ(table.Expired(kStart + seconds(111)).size(), 1U);
}

}  // namespace
}  // namespace calib::scheduler
