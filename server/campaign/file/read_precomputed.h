#pragma once
// The key `model.precomputed`: runs that exist already, one table of parameters and one of states.

#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// Reads both tables for the campaign's parameters and experiments (known). Samples whose states
/// are incomplete keep NaN and so count as diverged. Rows that have an effect which the key
/// `effects` declares are Precomputed::with_effects.
void ReadPrecomputed(MapReader& campaign_map, ReadContext& context, Campaign& campaign);

}  // namespace calib::campaign
