#pragma once
// A new iteration, or more samples of the last one.

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/planning/phases/step.h"
#include "server/planning/planner.h"

namespace calib::planning {

/// The rows of the campaign file, all of them.
Batch RowsOfFile(const campaign::Campaign& campaign);

/// Adds the batch to the plan, or what its method cannot do as the campaign's failure. Errors:
/// those of the store.
absl::Status Begin(Step& step, const absl::StatusOr<Batch>& batch);

}  // namespace calib::planning
