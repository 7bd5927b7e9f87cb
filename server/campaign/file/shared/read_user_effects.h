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

/// Reads `effects` of a map: what runs have that are not of this program's DEM (made elsewhere, or
/// by a program), each with strengths, `excludes` and whether it `acts`. Declares them in
/// model.user_effects, of the kind "held" and without a formula; those that act also join
/// model.effects. reference: where they come from.
void ReadHeldEffects(MapReader& map, bool is_new, const std::string& reference, dem::Model& model);

/// Parameters of effects that act and are neither calibrated nor have a default, dotted, with the
/// name of their effect in words. Of a campaign whose effects are held.
std::vector<std::string> NotCalibratedOfActing(const Campaign& campaign);

}  // namespace calib::campaign
