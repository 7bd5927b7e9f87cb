#pragma once
// The section `model.user_effects` of a campaign file: effects that are formulas.

#include "dem/simulation/scenario.h"
#include "server/campaign/map_reader.h"

namespace calib::campaign {

/// Reads `user_effects` of the map `model` and adds what is sound to model.user_effects: names,
/// syntax, units and null values are checked here. Call before effects and parameters are read.
void ReadUserEffects(MapReader& model_map, dem::Model& model);

}  // namespace calib::campaign
