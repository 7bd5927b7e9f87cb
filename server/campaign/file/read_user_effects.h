#pragma once
// The section `model.user_effects` of a campaign file: effects that are formulas.

#include "dem/model/scenario.h"
#include "server/campaign/file/map_reader.h"
#include "server/campaign/file/read_context.h"

namespace calib::campaign {

/// Reads `user_effects` of the map `model` and adds what is sound to model.user_effects: names,
/// syntax, units and null values are checked here; of a new campaign also that the prior of a
/// strength holds what the screen tries. Call before effects and parameters are read.
void ReadUserEffects(MapReader& model_map, const ReadContext& context, dem::Model& model);

}  // namespace calib::campaign
