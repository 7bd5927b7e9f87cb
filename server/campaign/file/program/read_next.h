#pragma once
// The key `model.next`: tests that a program can do and that have not been measured.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// Reads it into campaign.next. What a test leaves out, observables with their errors and
/// realizations, is as of the first calibrated experiment. Call once the experiments are known.
void ReadNext(MapReader& campaign_map, ReadContext& context, Campaign& campaign);

}  // namespace calib::campaign
