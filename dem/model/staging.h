#pragma once
// The engine's choice of how a quasi-static path is walked.

#include "dem/model/scenario.h"

namespace calib::dem {

/// Staging with every field set: the scenario's, or the engine's choice for a packing of this mean
/// diameter [m] > 0. Precondition: the test is one in the periodic cell, with a confining_pressure.
Staging ResolveStaging(const Scenario& scenario, double mean_diameter);

}  // namespace calib::dem
