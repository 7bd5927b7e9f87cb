#pragma once
// Units, signs and zeros of readings, against what is known of a test before it is run: where it
// begins.

#include <vector>

#include "server/campaign/checks/warning.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Warnings of the kinds unit, sign and offset for the readings of one experiment, and for a stress
/// that drives it. Of tests in the periodic cell the start is known: stresses are those of
/// consolidation, their difference and the strains zero, porosity and void ratio near the
/// specimen's. Pure.
/// in: readings in SI, NaN where missing
std::vector<Warning> StartWarnings(const Experiment& experiment);

}  // namespace calib::campaign
