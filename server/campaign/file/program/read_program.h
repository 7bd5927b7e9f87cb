#pragma once
// The key `model.command` and those beside it: a program of the user's own as the model.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// Whether the map `model` names a program.
bool NamesProgram(const MapReader& model);

/// Reads the map `model` into campaign.program, its effects into model.user_effects (those that act
/// also into model.effects). Files and folders are read through the context.
void ReadProgram(MapReader& model, ReadContext& context, Campaign& campaign);

/// What can be told once parameters and experiments are known: names with two meanings, effects
/// whose parameters nobody gives.
void CheckProgram(const MapReader& campaign_map, const Campaign& campaign);

}  // namespace calib::campaign
