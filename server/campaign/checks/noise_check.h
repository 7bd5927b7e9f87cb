#pragma once
// Whether the errors that a campaign states are those that its measured curves show.

#include <vector>

#include "server/campaign/checks/warning.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// A warning of kind scatter for each observable whose readings scatter from one to the next surely
/// more, or surely less, than its stated noise says (inference/data/reading_noise.h): of each
/// experiment, else, without an experiment, of all that calibrate together. Only with noise: given.
/// Less scatter says nothing against errors that are stated to go together from one reading to the
/// next (correlation_length, covariance): what they have in common shows in no difference.
/// Empty: nothing speaks against the noise stated, or the curves are too short to tell. Pure.
std::vector<Warning> NoiseWarnings(const Campaign& campaign);

}  // namespace calib::campaign
