#pragma once
// What a campaign's runs say of the scatter between packings when one packing is left out.

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "server/report/views/run_table.h"

namespace calib::diagnosis {

/// How many groups of runs share no packing in any fitted experiment with another group: run i is
/// of group StreamOf(i) mod that. Experiments of 4 and 6 packings have 2, not 4; 1 where packings
/// were not varied.
int PackingsApart(const campaign::Campaign& campaign);

/// Of each of those groups: the closed form of the scatter, a chain along the path for each
/// observable, from the replicates on all the others; T x T in the sd of readings.of_mean. None
/// where fewer than two replicates remain; no entries where packings were not varied. With twins of
/// each of them, from the others.
std::vector<std::optional<Eigen::MatrixXd>> ClosedFormsWithout(
    const campaign::Campaign& campaign, const report::ScatteredReadings& readings);

}  // namespace calib::diagnosis
