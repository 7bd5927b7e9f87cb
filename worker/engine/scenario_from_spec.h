#pragma once
// AttemptSpec -> dem::Scenario; the inverse of server/messages/attempt_spec.

#include "calib/v1/worker.pb.h"
#include "dem/model/scenario.h"

namespace calib::worker {

/// The scenario of a spec, its packing still empty (specimens.h supplies it).
dem::Scenario ScenarioFromSpec(const v1::AttemptSpec& spec);

/// The recipe of a message; its radii are empty where the message names a packing file that has
/// them (specimens.h reads it).
dem::PackingRecipe RecipeFromMessage(const v1::PackingRecipe& message);

}  // namespace calib::worker
