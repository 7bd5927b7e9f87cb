#pragma once
// The section `experiments`: one lab test each, with its specimen, protocol and measurements.

#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// Reads all experiments into the campaign (whose model and noise mode are known).
void ReadExperiments(MapReader& campaign_map, ReadContext& context, Campaign& campaign);

}  // namespace calib::campaign
