#pragma once
// The best estimate on every packing, or its twins on the only one: what they differ by is chance
// of one specimen.

#include "absl/status/status.h"
#include "server/planning/answer.h"
#include "server/planning/phases/step.h"

namespace calib::planning {

/// How often the best estimate is to be run; 0: its scatter is not asked for or cannot be had,
/// which the plan's log then says.
int ReplicatesWanted(Step& step);

/// All experiments, as samples of an iteration of their own: consecutive numbers meet every packing
/// once. Errors: those of the store.
absl::Status Replicate(Step& step, const Answer& answer, int count);

/// Of a step after them: they were twins on one packing, and have not parted.
bool TwinsShowNothing(const Step& step);

}  // namespace calib::planning
