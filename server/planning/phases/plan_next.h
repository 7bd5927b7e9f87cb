#pragma once
// What comes next for a campaign, computed from the store alone: the same records give the same
// bits, whatever the order in which workers delivered them and however often the server was killed
// in between.

#include "absl/status/statusor.h"
#include "server/planning/definition.h"
#include "server/planning/plan.h"
#include "server/store/reader.h"

namespace calib::planning {

/// The step after everything planned so far has ended: the first iteration; posterior and next
/// iteration; posterior and validation; the end. While evaluations are under way (decisions.h):
/// points that can be chosen by now, the posterior of an iteration that has ended, thresholds; or
/// nothing. Errors: those of the store. What inference cannot do becomes a plan with event kFail.
absl::StatusOr<Plan> PlanNext(const Definition& definition, const store::CampaignRecord& campaign,
                              store::Reader& reader);

}  // namespace calib::planning
