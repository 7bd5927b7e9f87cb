#pragma once
// Choices of the numerics that a measurement knows nothing of: what they change is no physics.

#include <vector>

#include "server/diagnosis/fitted_campaign.h"

namespace calib::diagnosis {

/// The run that comes closest again, with twice the rate of staging, half its step, and twice its
/// damping (half of it where that would be too much), in every fitted experiment that is read at
/// rest. Those with a loading_rate and flows are left as they are; empty where there are no others.
std::vector<campaign::Derivation> NumericalChanges(const FittedCampaign& base);

}  // namespace calib::diagnosis
