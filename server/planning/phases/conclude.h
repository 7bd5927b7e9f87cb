#pragma once
// The posterior of an iteration that has ended, then whatever follows from it.

#include "absl/status/status.h"
#include "server/planning/phases/step.h"

namespace calib::planning {

/// Of the last iteration: its posterior, then the next iteration where it is `affordable`,
/// replicates, or held-out experiments. Before that, where samples are weighed, runs that ended
/// early may go on. Errors: those of the store.
absl::Status Conclude(Step& step, bool affordable);

/// Posterior of the first iteration that has none, as if nothing had followed it. Errors: those of
/// the store.
absl::Status ConcludeEarlier(Step& step);

}  // namespace calib::planning
