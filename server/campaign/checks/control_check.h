#pragma once
// Order and zero of the readings of a control.

#include <vector>

#include "server/campaign/checks/warning.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Warnings of the kinds path_order and offset: rows that turn back at many readings or stand in
/// reversed order; a first strain behind the start of the test, or one at which the stresses are
/// still those that it begins with. Pure.
std::vector<Warning> ControlWarnings(const Experiment& experiment);

/// Readings at which the path turns back.
int TurningPointsOf(const Experiment& experiment);

}  // namespace calib::campaign
