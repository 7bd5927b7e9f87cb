#include "server/planning/transitions.h"

#include <gtest/gtest.h>

#include <array>

namespace calib::scheduler {
namespace {

using S = CampaignState;
using E = planning::CampaignEvent;

constexpr std::array kStates = {S::kQueued,   S::kRunning, S::kPaused,
                                S::kFinished, S::kFailed,  S::kCancelled};
constexpr std::array kEvents = {E::kStart,  E::kPause, E::kResume, E::kCancel,
                                E::kFinish, E::kFail,  E::kGrow};

TEST(Transitions, NothingHappensToACampaignThatIsOverButThatADesignGrows) {
  for (const S state : kStates) {
    for (const E event : kEvents) {
      if ((state == S::kFinished || state == S::kQueued) && event == E::kGrow) {
        EXPECT_EQ(*Next(state, event), S::kRunning);
      } else if (IsOver(state) || event == E::kGrow) {
        EXPECT_FALSE(Next(state, event).ok()) << ToString(event) << " " << ToString(state);
      }
    }
  }
}

TEST(Transitions, EveryLiveCampaignCanBeCancelledOrFail) {
  for (const S state : kStates) {
    if (!IsOver(state)) {
      EXPECT_EQ(*Next(state, E::kCancel), S::kCancelled);
      EXPECT_EQ(*Next(state, E::kFail), S::kFailed);
    }
  }
}

TEST(Transitions, OnlyQueuedAndRunningCampaignsAreWorkedOn) {
  for (const S state : kStates) {
    EXPECT_EQ(planning::IsLeasable(state), state == S::kQueued || state == S::kRunning)
        << ToString(state);
  }
}

TEST(Transitions, PauseAndResumeUndoEachOther) {
  EXPECT_EQ(*Next(S::kRunning, E::kPause), S::kPaused);
  EXPECT_EQ(*Next(S::kPaused, E::kResume), S::kRunning);
  EXPECT_EQ(Next(S::kPaused, E::kPause).status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(Next(S::kPaused, E::kPause).status().message().find("paused"), std::string::npos);
}

}  // namespace
}  // namespace calib::scheduler
