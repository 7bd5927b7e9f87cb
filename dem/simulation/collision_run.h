#pragma once
// The test `collision`: two bodies, one contact, by the model's own chain of kernels.

#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/simulation/scenario.h"

namespace calib::dem {

/// Runs every reading of the path as a collision of its own, up to 32 at a time as lanes of one
/// block of contacts, with 5000 steps in half a period of the contact at its largest overlap (the
/// first order of the leapfrog's damping then stays below 1e-5 of restitution). Calls sink in the
/// order of the path. Precondition: ScenarioProblems() finds nothing wrong.
Summary RunCollision(const Scenario& scenario, const StateSink& sink, std::stop_token stop);

/// What CheckTest cannot see: spin at normal incidence, bodies of too different sizes.
std::vector<std::string> CollisionProblems(const Scenario& scenario);

}  // namespace calib::dem
