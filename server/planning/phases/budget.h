#pragma once
// What a campaign may still spend (Budget of the campaign file).

#include <cstdint>

#include "server/planning/phases/step.h"

namespace calib::planning {

/// True when the next iteration would exceed what the user allowed.
bool BudgetSpent(const Step& step);
/// How many samples more would not.
std::int64_t Affordable(const Step& step);
/// True when so many evaluations, beside those under way, would exceed it, core hours as those so
/// far took them.
bool Exceeds(const Step& step, std::int64_t next);

}  // namespace calib::planning
