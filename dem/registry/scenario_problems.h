#pragma once
// What can be known to be wrong with a scenario before it runs.

#include <string>
#include <vector>

#include "dem/model/scenario.h"

namespace calib::dem {

/// Everything wrong with a scenario that can be known without running it, one sentence each; empty:
/// runnable.
std::vector<std::string> ScenarioProblems(const Scenario& scenario);

}  // namespace calib::dem
