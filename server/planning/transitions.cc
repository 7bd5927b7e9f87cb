#include "server/planning/transitions.h"

#include <array>

#include "absl/strings/str_cat.h"

namespace calib::planning {
namespace {

using S = CampaignState;
using E = CampaignEvent;

struct Transition {
  S from;
  E event;
  S to;
};

constexpr std::array kTransitions = {
    Transition{S::kQueued, E::kStart, S::kRunning},
    Transition{S::kQueued, E::kPause, S::kPaused},
    Transition{S::kQueued, E::kCancel, S::kCancelled},
    Transition{S::kQueued, E::kFail, S::kFailed},
    Transition{S::kQueued, E::kFinish, S::kFinished},  // every evaluation was reused
    Transition{S::kRunning, E::kStart, S::kRunning},
    Transition{S::kRunning, E::kPause, S::kPaused},
    Transition{S::kRunning, E::kCancel, S::kCancelled},
    Transition{S::kRunning, E::kFail, S::kFailed},
    Transition{S::kRunning, E::kFinish, S::kFinished},
    Transition{S::kPaused, E::kResume, S::kRunning},
    Transition{S::kPaused, E::kCancel, S::kCancelled},
    Transition{S::kPaused, E::kFail, S::kFailed},  // the computation that ran when it was paused
    Transition{S::kPaused, E::kFinish, S::kFinished},  // likewise
    Transition{S::kFinished, E::kGrow, S::kRunning},
    Transition{S::kQueued, E::kGrow, S::kRunning},  // submitted just now: once that has finished
};

}  // namespace

const char* ToString(CampaignEvent event) {
  switch (event) {
    case E::kStart:
      return "start";
    case E::kPause:
      return "pause";
    case E::kResume:
      return "resume";
    case E::kCancel:
      return "cancel";
    case E::kFinish:
      return "finish";
    case E::kGrow:
      return "grow";
    case E::kFail:
      break;
  }
  return "fail";
}

absl::StatusOr<CampaignState> Next(CampaignState from, CampaignEvent event) {
  for (const Transition& transition : kTransitions) {
    if (transition.from == from && transition.event == event) {
      return transition.to;
    }
  }
  return absl::FailedPreconditionError(
      absl::StrCat("cannot ", ToString(event), " a campaign that is ", ToString(from)));
}

bool IsLeasable(CampaignState state) { return state == S::kQueued || state == S::kRunning; }

}  // namespace calib::planning
