#include "worker/held_attempt.h"

#include <gtest/gtest.h>

namespace calib::worker {
namespace {

void AddStates(HeldAttempt& attempt, int first, int count) {
  for (int i = first; i < first + count; ++i) {
    v1::State state;
    state.set_load_step(i);
    state.add_values(i);
    attempt.AddState(state);
  }
}

v1::Lease LeaseOfSeven() {
  v1::Lease lease;
  lease.set_attempt(7);
  return lease;
}

v1::Finished Completed() {
  v1::Finished finished;
  finished.set_outcome(v1::Finished::OUTCOME_COMPLETED);
  return finished;
}

TEST(HeldAttempt, SendsEachStateOnceAndTheEndLast) {
  HeldAttempt attempt(LeaseOfSeven());
  AddStates(attempt, 0, 2);
  auto messages = attempt.TakeUnsent();
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_EQ(messages[0].states().attempt(), 7);
  EXPECT_EQ(messages[0].states().first(), 0);
  EXPECT_EQ(messages[0].states().states_size(), 2);
  EXPECT_TRUE(attempt.TakeUnsent().empty());
  AddStates(attempt, 2, 1);
  attempt.AddEnd(Completed());
  messages = attempt.TakeUnsent();
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].states().first(), 2);
  EXPECT_TRUE(messages[1].has_finished());
  EXPECT_TRUE(attempt.TakeUnsent().empty());
}

TEST(HeldAttempt, StatesThatAreTakenToGoWithOthersAreNotSentAgain) {
  HeldAttempt attempt(LeaseOfSeven());
  AddStates(attempt, 0, 2);
  attempt.AddEnd(Completed());
  const auto batches = attempt.TakeUnsentStates();
  ASSERT_EQ(batches.size(), 1U);
  EXPECT_EQ(batches[0].attempt(), 7);
  EXPECT_EQ(batches[0].states_size(), 2);
  EXPECT_TRUE(attempt.TakeUnsentStates().empty());
  const auto messages = attempt.TakeUnsent();
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_TRUE(messages[0].has_finished()) << "the end is left";
}

TEST(HeldAttempt, SendsWhatIsNotAcknowledgedAgainOverANewStream) {
  HeldAttempt attempt(LeaseOfSeven());
  AddStates(attempt, 0, 5);
  attempt.AddEnd(Completed());
  (void)attempt.TakeUnsent();
  attempt.Acknowledge(3);
  attempt.StreamLost();
  const auto messages = attempt.TakeUnsent();
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].states().first(), 3);
  EXPECT_EQ(messages[0].states().states_size(), 2);
  EXPECT_EQ(messages[0].states().states(0).load_step(), 3);
  EXPECT_TRUE(messages[1].has_finished());
}

TEST(HeldAttempt, LargeBacklogGoesInBatchesBelowTheMessageLimit) {
  HeldAttempt attempt(LeaseOfSeven());
  AddStates(attempt, 0, 2500);
  const auto messages = attempt.TakeUnsent();
  ASSERT_EQ(messages.size(), 3U);
  EXPECT_EQ(messages[2].states().first(), 2000);
  for (const auto& message : messages) {
    EXPECT_LT(message.ByteSizeLong(), 1U << 20);
  }
}

}  // namespace
}  // namespace calib::worker
