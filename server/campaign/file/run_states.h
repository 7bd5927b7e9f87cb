#pragma once
// States of runs that exist already, at the readings of each experiment.

#include <map>
#include <vector>

#include "server/campaign/file/run_table.h"

namespace calib::campaign {

/// Reads the table of states for the campaign's experiments (known). Steps count from 0 or 1 and
/// are the readings; where the table has the control and it lies elsewhere than the readings', runs
/// that reach what was measured are interpolated along it.
/// row_of_sample: row of each sample in the table of parameters.
/// out: [experiment][sample][reading * observables + observable], SI, NaN where a run has no state;
/// meaningful only if no problem was added
std::vector<std::vector<std::vector<double>>> ReadRunStates(
    MapReader& map, const RunTableKeys& keys, const Campaign& campaign,
    const std::map<int, Eigen::Index>& row_of_sample, ReadContext& context);

}  // namespace calib::campaign
