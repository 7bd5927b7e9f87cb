#pragma once
// The engine's choice of how a quasi-static path is walked.

#include "dem/model/scenario.h"

namespace calib::dem {

/// Staging with every field set: what the scenario sets, and the engine's choice, for a packing of
/// this mean diameter [m] > 0, of what it leaves open. Pure. Precondition: the test is in the
/// periodic cell and has a setting confining_pressure.
Staging ResolveStaging(const Scenario& scenario, double mean_diameter);

}  // namespace calib::dem
