#pragma once
// tmcmc: every Metropolis step of every stage is one batch, the proposals of all chains. Where the
// chains stand follows from the stored samples and states (computed again after a start, kept from
// plan to plan after that); whether a proposal is accepted was decided by a number drawn before it
// ran, so neither order nor restarts matter.

#include <memory>

#include "inference/tmcmc/tmcmc.h"
#include "server/planning/planner.h"

namespace calib::methods {

/// options: steps and target_cv; the rest follows from the campaign. Keeps a reference to the
/// definition.
std::unique_ptr<planning::Planner> MakeTmcmcPlanner(const planning::Definition& definition,
                                                    const inference::TmcmcOptions& options);

}  // namespace calib::methods
