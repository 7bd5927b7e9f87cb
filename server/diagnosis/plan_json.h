#pragma once
// Proposals as JSON, and read back.

#include <nlohmann/json_fwd.hpp>

#include "absl/status/statusor.h"
#include "server/diagnosis/test_plans.h"

namespace calib::diagnosis {

nlohmann::json PlannedJson(const PlannedExperiment& planned);

/// What of a proposal says how it is made. INVALID_ARGUMENT where something of that is missing.
absl::StatusOr<PlannedExperiment> PlannedFrom(const nlohmann::json& json);

}  // namespace calib::diagnosis
