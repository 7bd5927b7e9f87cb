#pragma once
// Planned tests that change several things at once.

#include <optional>
#include <vector>

#include "server/diagnosis/test_plans.h"

namespace calib::diagnosis {

/// Changes that a grid is made of.
inline constexpr std::size_t kChangesOfGrid = 3;

/// What both change of the test as it was done, changed at once: test, each setting, and the way
/// that it is driven. Empty where they change the same thing to different values, where nothing is
/// added to one of them, or where a setting would also drive the test.
std::optional<PlannedExperiment> Together(const PlannedExperiment& as_done,
                                          const PlannedExperiment& a, const PlannedExperiment& b);

/// Of plans that change one thing each, best first: the best and the two next that change other
/// things, in every combination of two and of three. At most four; empty where no two go together.
std::vector<PlannedExperiment> GridOf(const PlannedExperiment& as_done,
                                      const std::vector<PlannedExperiment>& best_first);

}  // namespace calib::diagnosis
