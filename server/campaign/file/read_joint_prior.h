#pragma once
// What ties the parameters of a campaign together before any data: correlations of their priors and
// linear constraints between them.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Reads prior_correlation (a list of [NAME, NAME, number]) and constraints (a list of inequalities
/// of sums, "friction_angle <= 0.5 * other + 3 deg") once campaign.parameters are known, and sets
/// campaign.tied_prior where one of them is given. Numbers take units; a term has the unit of its
/// number times that of its parameter, and all terms of a constraint measure the same thing.
void ReadJointPrior(MapReader& campaign_map, Campaign& campaign);

}  // namespace calib::campaign
