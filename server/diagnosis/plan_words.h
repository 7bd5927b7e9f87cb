#pragma once
// Planned tests in words.

#include <string>

#include "server/diagnosis/test_plans.h"

namespace calib::diagnosis {

/// "triaxial_drained, confining pressure 447 kPa, one unloading and reloading at 1.6 %": what the
/// plan sets; of a path its values only where no axial strain drives the test.
std::string InWords(const PlannedExperiment& planned);

/// How the control goes: "axial strain to 1.6 %, back to 0.8 %, then to 8 %"; of a test whose
/// values are runs of their own "impact angle at 20 values from 5 deg to 80 deg".
std::string WayInWords(const PlannedExperiment& planned);

}  // namespace calib::diagnosis
