#pragma once
// What several observables share of their errors: noise: {inferred: [...]}, one factor on them, and
// noise: {model_error: [...]}, what the model is off by.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Reads the list under noise.inferred or noise.model_error once the experiments are known, into
/// campaign.shared_noise or campaign.model_errors. An entry has `observables` (NAME: of every
/// experiment that calibrates; EXPERIMENT.NAME), none of which stands in two. Of a factor: its
/// prior, inverse gamma of `shape` and `rate` (1/2 each). Of a model error: `relative`, `absolute`
/// or both, each a prior of a standard deviation, or of its square with `on: variance`. Does
/// nothing for noise of another form.
void ReadNoiseGroups(MapReader& campaign_map, Campaign& campaign);

}  // namespace calib::campaign
