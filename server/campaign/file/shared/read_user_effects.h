#pragma once
// Effects that a campaign file declares: the section `model.user_effects`, effects that are
// formulas, and the parameters of any.

#include "dem/model/scenario.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// Reads `parameters` of the map of one effect, whose name is known: nulls, priors, signs and steps
/// as parameters, rays and two_sided of the effect. A name may begin with that of its effect and a
/// dot. is_new: of a new campaign also that the prior of a strength holds what is tried. What is
/// wrong is added to the map's problems.
void ReadEffectParameters(MapReader& map, bool is_new, dem::EffectInfo& effect);

/// Reads `user_effects` of the map `model` and adds what is sound to model.user_effects: names,
/// syntax, units and null values are checked here; of a new campaign also that the prior of a
/// strength holds what the screen tries. Call before effects and parameters are read.
void ReadUserEffects(MapReader& model_map, const ReadContext& context, dem::Model& model);

}  // namespace calib::campaign
