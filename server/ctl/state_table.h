#pragma once
// Tables of states of several experiments as one.

#include <string>
#include <utility>
#include <vector>

namespace calib::ctl {

/// (experiment, its table `load_step,<observables>`) -> `experiment,load_step,<union of the
/// observables>`; fields are copied as they are, empty where an experiment has no such observable.
/// A last row that is not complete yet is left out.
std::string JoinStateTables(const std::vector<std::pair<std::string, std::string>>& tables);

}  // namespace calib::ctl
