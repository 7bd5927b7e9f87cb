#pragma once
// Checks of a scenario: which bodies and grains are of which material.

#include <string>
#include <vector>

#include "dem/model/scenario.h"

namespace calib::dem {

/// Bodies of a test (a name of Tests()) that may be of another material than the grains: names for
/// MaterialUse::bodies.
std::vector<std::string> BodiesOf(const std::string& test);

/// Everything wrong with MaterialUse and the materials of the packing, one sentence each.
std::vector<std::string> MaterialUseProblems(const Scenario& scenario);

}  // namespace calib::dem
