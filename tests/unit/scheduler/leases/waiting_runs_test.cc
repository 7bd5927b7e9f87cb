#include "server/scheduler/leases/waiting_runs.h"

#include <gtest/gtest.h>

namespace calib::scheduler {
namespace {

store::EvaluationKey Key(std::int64_t campaign, int sample) {
  return {.campaign = campaign, .sample = sample, .experiment = 0};
}

TEST(WaitingRuns, FirstOfEachGroupIsKnownWhateverComesAndGoes) {
  WaitingRuns waiting;
  EXPECT_TRUE(waiting.empty());
  waiting.Put(Key(1, 5), "");
  waiting.Put(Key(1, 3), "");
  waiting.Put(Key(1, 3), "");
  waiting.Put(Key(1, 4), "folder");
  waiting.Put(Key(2, 0), "");
  EXPECT_EQ(waiting.size(), 4U);
  EXPECT_EQ(waiting.Groups(), (std::vector<WaitingRuns::Group>{{1, ""}, {1, "folder"}, {2, ""}}));
  EXPECT_EQ(waiting.First({1, ""}), Key(1, 3));
  EXPECT_EQ(waiting.First({1, "folder"}), Key(1, 4));
  waiting.Take(Key(1, 3));
  waiting.Take(Key(1, 3));
  EXPECT_EQ(waiting.First({1, ""}), Key(1, 5));
}

TEST(WaitingRuns, WhatRestsElsewhereChangesItsGroup) {
  WaitingRuns waiting;
  waiting.Put(Key(1, 5), "");
  waiting.Put(Key(1, 5), "folder");
  EXPECT_EQ(waiting.First({1, ""}), std::nullopt);
  EXPECT_EQ(waiting.First({1, "folder"}), Key(1, 5));
  EXPECT_EQ(waiting.size(), 1U);
}

TEST(WaitingRuns, ACampaignIsTakenOutAsAWhole) {
  WaitingRuns waiting;
  waiting.Put(Key(1, 5), "");
  waiting.Put(Key(2, 1), "a");
  waiting.Put(Key(2, 2), "b");
  waiting.Put(Key(3, 0), "");
  waiting.TakeAll(2);
  EXPECT_EQ(waiting.Groups(), (std::vector<WaitingRuns::Group>{{1, ""}, {3, ""}}));
  EXPECT_EQ(waiting.size(), 2U);
}

}  // namespace
}  // namespace calib::scheduler
