#pragma once
// Held-out experiments, for the samples that carry the posterior.

#include "absl/status/status.h"
#include "server/planning/answer.h"
#include "server/planning/phases/step.h"

namespace calib::planning {

/// After a conclusion. Where nothing is held out the campaign is finished. Errors: those of the
/// store.
absl::Status Validate(Step& step, const Answer& answer);

}  // namespace calib::planning
