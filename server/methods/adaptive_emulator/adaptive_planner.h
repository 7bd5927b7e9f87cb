#pragma once
// What comes next for a campaign of adaptive_emulator: batches of inference::DecideAdaptive, whose
// memory of each is stored with it. Readings are seen as smooth functions of each stage
// (inference::ProjectStages); what these leave out is judged by the emulator of all methods, which
// is asked at the end and gives the posterior that is reported.

#include <memory>

#include "inference/adaptive/adaptive_decision.h"
#include "server/planning/planner.h"

namespace calib::methods {

/// options: max_runs and batch; the others follow from the campaign. Asked for more while runs are
/// under way, it chooses from the batches before the last. Keeps a reference to the definition.
std::unique_ptr<planning::Planner> MakeAdaptivePlanner(const planning::Definition& definition,
                                                       const inference::AdaptiveOptions& options);

}  // namespace calib::methods
