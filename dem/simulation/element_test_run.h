#pragma once
// Walks an element test: consolidation, then the control path, reporting each load step.

#include <functional>
#include <stop_token>

#include "absl/status/statusor.h"
#include "dem/dynamics/assembly.h"
#include "dem/simulation/scenario.h"

namespace calib::dem {

/// Called at each load step with its state and the grains that made it. An error ends the run with
/// that error.
using LoadStepSink = std::function<absl::Status(const State& state, const Assembly& assembly)>;

/// Precondition: ScenarioProblems(scenario) is empty. Errors as Simulate(), and those of the sink.
absl::StatusOr<Summary> RunElementTest(const Scenario& scenario, const LoadStepSink& sink,
                                       std::stop_token stop);

}  // namespace calib::dem
