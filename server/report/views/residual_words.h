#pragma once
// What a model leaves unexplained, in sentences: readings beyond the prior, which observable, which
// stage, sign, shape, discrepancy along the path, dependence on pressure or rate, parameters that
// are bent.

#include <string>
#include <vector>

#include "server/report/views/comparison.h"

namespace calib::report {

/// The heaviest first; at most `kMostStages` stages. Empty when nothing stands out.
std::vector<std::string> WhereItFails(const Comparison& comparison);

inline constexpr int kMostStages = 4;

}  // namespace calib::report
