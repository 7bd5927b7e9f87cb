#pragma once
// Readings that the runs do not answer to, and parameters that the readings do not tell of.

#include <span>
#include <string>
#include <vector>

#include "server/planning/answer.h"
#include "server/planning/definition.h"

namespace calib::planning {

/// A sentence for each fitted observable that is the same in all finished runs to within a tenth of
/// its errors (checks/run_table_check.h). None with fewer than two of them. Pure.
/// iterations: at least one, predictions N x T in the order of the definition's readings
std::vector<std::string> UnmovedReadings(const Definition& definition,
                                         std::span<const inference::Iteration> iterations);

/// A sentence that names the parameters whose 5, 50 and 95 % quantiles are those of their prior to
/// within 2 % of its probability, and two sd of what so many samples leave to chance; empty: none,
/// no intervals, or priors that are tied, whose marginals are not the stated ones. Pure.
std::string UnmovedParameters(const Definition& definition, const Answer& answer);

}  // namespace calib::planning
