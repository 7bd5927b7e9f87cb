#pragma once
// Everything that is odd about a campaign before it is run.

#include <vector>

#include "server/campaign/checks/warning.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// By experiment those of control_check.h and start_check.h, errors beyond the range of their
/// readings, observables that follow from others, heaps of too few grains; then those of
/// noise_check.h and run_table_check.h. Pure. in: a campaign without problems
std::vector<Warning> WarningsOf(const Campaign& campaign);

}  // namespace calib::campaign
