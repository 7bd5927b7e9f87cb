#pragma once
// The life of a campaign: one table (from, event) -> to. Pure.

#include "absl/status/statusor.h"
#include "server/campaign/model/words.h"

namespace calib::planning {

using campaign::CampaignState;

enum class CampaignEvent {
  kStart,  ///< its first evaluation was handed out, or its runs exist already
  kPause,  ///< asked for, or too many samples diverged or failed
  kResume,
  kCancel,
  kFinish,  ///< nothing is left to be run
  kFail,    ///< no posterior can be computed
  kGrow,    ///< runs were added to a design that had finished, as one without runs does at once
};

const char* ToString(CampaignEvent event);

/// FAILED_PRECONDITION, naming the present state, when the event is not allowed in it.
absl::StatusOr<CampaignState> Next(CampaignState from, CampaignEvent event);

/// Its evaluations may be handed out.
bool IsLeasable(CampaignState state);

}  // namespace calib::planning
