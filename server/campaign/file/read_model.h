#pragma once
// The sections `model` and `parameters` of a campaign file.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/read_context.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Reads contact, effects, density and fixed parameters; with precomputed runs, and with a program
/// (program/read_program.h), none of them is needed.
void ReadModel(MapReader& campaign_map, ReadContext& context, Campaign& campaign);

/// Reads the calibrated parameters, of the model and of experiments (file/parameters),
/// their priors and those that are tied to them, then checks
/// that every parameter of the model has exactly one source: calibrated, tied, fixed, or the
/// catalogue's default. Call after ReadModel.
void ReadParameters(MapReader& campaign_map, bool is_new, Campaign& campaign);

/// Whether what is tied is admissible over the whole prior. Call after ReadJointPrior.
void CheckTied(MapReader& campaign_map, const Campaign& campaign);

}  // namespace calib::campaign
