#pragma once
// What can be known to be wrong with a scenario before it runs.

#include <string>
#include <vector>

#include "dem/model/scenario.h"
#include "dem/model/test_entry.h"

namespace calib::dem {

/// Everything wrong with a scenario that can be known without running it, one sentence each; empty:
/// runnable.
std::vector<std::string> ScenarioProblems(const Scenario& scenario);

/// What grains of these radii [m], at least one, make of a scenario in place of its packing's: what
/// its test says, and meshes that do not go with them. Precondition: ScenarioProblems() finds
/// nothing.
GrainRemarks GrainRemarksOf(const Scenario& scenario, const std::vector<double>& radii);

}  // namespace calib::dem
