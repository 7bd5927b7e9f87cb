#pragma once
// `--set NAME=VALUE[ unit]` against the parameters of a campaign.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/campaign/model/campaign.h"

namespace calib::ctl {

/// Sets fixed parameters in `campaign` and returns the values of the calibrated ones in order (SI).
/// INVALID_ARGUMENT with one line per problem: not NAME=VALUE, no such parameter, not a number of
/// the right kind, outside what is admissible, given twice, a calibrated parameter left out.
absl::StatusOr<std::vector<double>> ApplyAssignments(const std::vector<std::string>& assignments,
                                                     campaign::Campaign& campaign);

}  // namespace calib::ctl
