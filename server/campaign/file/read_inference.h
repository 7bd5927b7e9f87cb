#pragma once
// How the campaign is inferred and run: noise, inference, early_stopping, failure, budget, seed.

#include "server/campaign/file/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

void ReadInference(MapReader& campaign_map, Campaign& campaign);

/// What can be said only once the parameters are known.
void CheckSamples(MapReader& campaign_map, const Campaign& campaign);
/// What needs the parameters: rows of a table, the first proposal; and where the campaign comes
/// from.
void ReadStart(MapReader& campaign_map, Campaign& campaign);

/// One replicate measures no scatter.
void CheckReplicates(const MapReader& campaign_map, const Campaign& campaign);
/// The budget has to allow one iteration. To be called once the experiments are known.
void CheckBudget(const MapReader& campaign_map, const Campaign& campaign);

}  // namespace calib::campaign
