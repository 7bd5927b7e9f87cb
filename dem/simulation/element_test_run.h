#pragma once
// Walks an element test: consolidation, then the control path, reporting each load step.

#include <stop_token>

#include "absl/status/statusor.h"
#include "dem/simulation/run_record.h"
#include "dem/simulation/scenario.h"

namespace calib::dem {

/// Precondition: ScenarioProblems(scenario) is empty. Errors as Simulate(), and those of the
/// record.
absl::StatusOr<Summary> RunElementTest(const Scenario& scenario, RunRecord& record,
                                       std::stop_token stop);

/// The same without checkpoints.
absl::StatusOr<Summary> RunElementTest(const Scenario& scenario, const LoadStepSink& sink,
                                       std::stop_token stop);

}  // namespace calib::dem
