#pragma once
// noise: {inferred: [...]}: which observables share one factor of their noise.

#include "server/campaign/file/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Reads the list under noise.inferred once the experiments are known, into campaign.shared_noise.
/// An entry has `observables` (NAME: of every experiment that calibrates; EXPERIMENT.NAME) and the
/// prior of their common variance factor, inverse gamma of `shape` and `rate` (1/2 each). Does
/// nothing for noise of another form.
void ReadNoiseGroups(MapReader& campaign_map, Campaign& campaign);

}  // namespace calib::campaign
