#pragma once
// The key `resources`: what one run needs.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// campaign.program and campaign.precomputed are known.
void ReadResources(MapReader& campaign_map, Campaign& campaign);

}  // namespace calib::campaign
