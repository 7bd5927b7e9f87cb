#pragma once
// What comes next for a campaign of a filter.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/planning/planner.h"

namespace calib::methods {

/// Parameters that an iteration and all later ones hold at their mean so far.
struct Freeze {
  bool converged = false;            ///< those whose mean the iteration before has left alone
  std::vector<std::string> names{};  ///< and these
};

struct FilterPlan {
  bool once = false;               ///< one iteration is all there is
  std::map<int, Freeze> freeze{};  ///< by iteration, from 1
};

/// Keeps references to the definition and the plan.
std::unique_ptr<planning::Planner> MakeFilterPlanner(const planning::Definition& definition,
                                                     const FilterPlan& plan);

}  // namespace calib::methods
