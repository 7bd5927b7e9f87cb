#pragma once
// Whether the errors that a campaign states are those that its measured curves show.

#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// One sentence for each observable whose readings scatter from one to the next surely more, or
/// surely less, than its stated noise says (inference/data/reading_noise.h): of each experiment,
/// else of all that calibrate together. Only with noise: given. Empty: nothing speaks against the
/// noise stated, or the curves are too short to tell. Pure.
std::vector<std::string> NoiseWarnings(const Campaign& campaign);

}  // namespace calib::campaign
