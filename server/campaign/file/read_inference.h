#pragma once
// How the campaign is inferred and run: noise, inference, early_stopping, failure, budget, seed.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Reads noise, inference, early_stopping, failure, budget and seed.
void ReadInference(MapReader& campaign_map, const MethodList& methods, Campaign& campaign);

/// Adds a problem where the number of samples does not suit the parameters. To be called once these
/// are known.
void CheckSamples(MapReader& campaign_map, const Campaign& campaign);
/// Reads what needs the parameters: rows of a table, the first proposal; and where the campaign
/// comes from (lineage).
void ReadStart(MapReader& campaign_map, const MethodList& methods, Campaign& campaign);

/// Adds a problem for a single replicate, which measures no scatter.
void CheckReplicates(const MapReader& campaign_map, const Campaign& campaign);
/// Adds a problem where the budget does not allow one iteration. To be called once the experiments
/// are known.
void CheckBudget(const MapReader& campaign_map, const Campaign& campaign);

}  // namespace calib::campaign
