#pragma once
// The life of a campaign: one table (from, event) -> to. Pure.

#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace calib::scheduler {

enum class CampaignState { kQueued, kRunning, kPaused, kFinished, kFailed, kCancelled };

enum class CampaignEvent {
  kStart,  ///< its first evaluation was handed out, or its runs exist already
  kPause,  ///< asked for, or too many samples diverged or failed
  kResume,
  kCancel,
  kFinish,  ///< nothing is left to be run
  kFail,    ///< no posterior can be computed
};

const char* ToString(CampaignState state);
const char* ToString(CampaignEvent event);
/// Inverse of ToString; empty for another text.
std::optional<CampaignState> ToCampaignState(const std::string& text);

/// FAILED_PRECONDITION, naming the present state, when the event is not allowed in it.
absl::StatusOr<CampaignState> Next(CampaignState from, CampaignEvent event);

/// Nothing happens to it any more.
bool IsOver(CampaignState state);
/// Its evaluations may be handed out.
bool IsLeasable(CampaignState state);

}  // namespace calib::scheduler
