#pragma once
// What a reader has to be warned of before believing an answer.

#include <string>
#include <vector>

#include "server/report/views/campaign_view.h"

namespace calib::report {

/// Whole sentences: those of the inference, then iterations that ended unsettled.
std::vector<std::string> PosteriorWarnings(const CampaignView& view);
/// PosteriorWarnings(), then parameters at a bound of their prior.
std::vector<std::string> Warnings(const CampaignView& view);

}  // namespace calib::report
