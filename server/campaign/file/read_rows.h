#pragma once
// Runs given one by one: the rows of a table or a design, and the race of a design.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Reads inference.race of a design. Call after ReadModel.
void ReadRace(MapReader& inference, Campaign& campaign);

/// Reads inference.rows, which a table needs and a design may have. Call once the parameters are
/// known.
void ReadRows(MapReader& inference, Campaign& campaign);

/// Adds a problem for each effect of the race that has no strength to race with, or cannot join the
/// model, for numerics that no test has, and for rows that cannot be run. Call once the experiments
/// are known.
void CheckDesign(const MapReader& campaign_map, const Campaign& campaign);

}  // namespace calib::campaign
