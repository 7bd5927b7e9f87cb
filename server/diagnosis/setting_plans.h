#pragma once
// Planned tests where no axial strain is driven under a pressure: collisions, flows, shearing,
// compression by a stress.

#include <vector>

#include "server/diagnosis/test_plans.h"

namespace calib::diagnosis {

/// The pattern's test with nothing changed.
PlannedExperiment AsMeasured(const campaign::Experiment& pattern);

/// The pattern's test with one thing changed at a time, by a factor of 4 (1.5 of flows under
/// gravity, in whose geometry little else runs) either way: every length, speed, angle or pressure
/// that the campaign file sets; the range of its control; another control (collisions: the speed in
/// the place of the angle); its loading_rate. A control that is a stress goes on to four times its
/// highest value, and one that may reverse is unloaded once half-way where it was not. Values that
/// the catalogue does not allow are left out. Empty for tests that the catalogue does not know.
std::vector<PlannedExperiment> SettingPlans(const campaign::Experiment& pattern);

}  // namespace calib::diagnosis
